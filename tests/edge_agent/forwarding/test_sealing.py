"""What the topic table seals is sealed before it is on a disk or a link; the rest is as it was."""

from __future__ import annotations

import random  # noqa: TID251 - seeded
from dataclasses import replace
from pathlib import Path

import pytest

from edge_agent.blackbox.box import RingSnapshot
from edge_agent.blackbox.clip import Span, write_clip
from edge_agent.blackbox.publisher import RecordedPublisher
from edge_agent.blackbox.ring import Ring
from edge_agent.config.settings import Settings, load_settings
from edge_agent.config.topic_table import Seal, TopicRule, TopicTable
from edge_agent.forwarding.channels import Channel, Channels
from edge_agent.forwarding.live_batch import Linger
from edge_agent.forwarding.live_queue import LiveQueue
from edge_agent.forwarding.pipeline import Arrival, Pipeline
from edge_agent.forwarding.sealing import Sealing, open_sealing
from edge_agent.outbox import LOGS, Outbox
from edge_agent.outbox.segment import Kind
from metaros._proto import link_pb2
from metaros.cdr import codec
from metaros.clock import ManualClock
from metaros.errors import ConfigError, SealError
from metaros.idl import catalogue_of, default_catalogue, message_class, type_hash
from metaros.limits import LIMITS
from metaros.link import BACKFILL_BIT
from metaros.record import open_bag
from metaros.record.ledger import Publisher
from metaros.record.unseal import unseal
from metaros.seal import OVERHEAD_BYTES, Keyring, Opener, Origin, SealKey, parse_head
from tests.edge_agent.parts import accept, make_outbox, taken
from tests.support.simulation.sim_disk import SimDisk

TYPE = "std_msgs/msg/String"
HASH = type_hash(TYPE, default_catalogue())
MARKER = b"plaintext-marker-4711"
CLOCK = ManualClock()


def origin(topic: str) -> Origin:
    """Of the robot's channel."""
    return Origin(robot="r1", topic=topic, type_name=TYPE, type_hash=HASH)


class Robot:
    """An agent's path from the tap to disk and live queue, with sealing."""

    def __init__(self, tmp_path: Path, *rules: TopicRule, disk: SimDisk | None = None, seed: int = 1) -> None:
        self.path = tmp_path / "seal.keys"
        if not self.path.exists():
            Keyring((SealKey.make(CLOCK),)).save(self.path)
        self.clock = ManualClock()
        self.outbox: Outbox = make_outbox(disk, self.clock, seed=seed)
        self.channels = Channels(TopicTable(rules), self.outbox.ids, namespace="/")
        self.sealing = Sealing(self.path, "r1", self.clock)
        self.live = LiveQueue()
        self.live.seal = self.sealing.live(lambda: self.outbox.live_epoch)
        self.outbox.seal = self.sealing.accepted(self.channels.by_id)
        self.pipeline = Pipeline(self.outbox, self.live, Linger(), wake_writer=lambda: None, wake_uplink=lambda: None)
        self.outbox.online = True

    def channel(self, topic: str, type_name: str = TYPE) -> Channel:
        """The topic, seen."""
        hash_text = type_hash(type_name, default_catalogue())
        found = self.channels.observe(topic, type_name, hash_text, qos="", keeps_all=False)
        assert found is not None
        return found

    def put(self, channel: Channel, payload: bytes, stamp_ns: int = 1) -> None:
        """A sample comes in."""
        self.clock.advance(1.0)
        now_s = self.clock.monotonic_s()
        self.pipeline.take([Arrival(channel, payload, len(payload), stamp_ns, now_s)], now_s)

    def sent(self, log: str) -> list[tuple[int, int, bytes]]:
        """(stream, seq, payload) of what a log has to send, singly."""
        found = []
        for item in taken(self.outbox, log):
            if item.frame.kind is Kind.GAP:
                continue
            batch = link_pb2.Batch.FromString(item.frame.body)
            at = 0
            for index in range(item.frame.count):
                size = int.from_bytes(batch.lengths[4 * index : 4 * index + 4], "little")
                found.append((item.frame.stream_id, item.frame.first_seq + index, batch.payload[at : at + size]))
                at += size
        return found


def rule(match: str, seal: Seal, **more: object) -> TopicRule:
    """A row that takes everything of a topic as bulk."""
    return replace(TopicRule(match=match, delivery="bulk", seal=seal), **more)  # type: ignore[arg-type]


def test_durable_samples_are_sealed_under_the_numbers_they_are_stored_by(tmp_path: Path) -> None:
    robot = Robot(tmp_path, rule("/secret", "sealed"), rule("**", "clear"))
    secret, plain = robot.channel("/secret"), robot.channel("/plain")
    for _ in range(3):
        robot.put(secret, MARKER)
        robot.put(plain, MARKER)
    found = robot.sent("bulk")
    assert [payload for stream, _, payload in found if stream == plain.channel_id] == [MARKER] * 3
    opener = Opener(Keyring.load(robot.path))
    frames = [(seq, payload) for stream, seq, payload in found if stream == secret.channel_id]
    assert [seq for seq, _ in frames] == [1, 2, 3]
    for seq, payload in frames:
        opened, head = opener.open(payload, origin("/secret"), seq=seq)
        assert opened == MARKER
        assert (head.stream, head.epoch, head.seq) == (secret.channel_id, robot.outbox.live_epoch, seq)
    with pytest.raises(SealError):
        opener.open(frames[0][1], origin("/plain"))


def test_no_file_of_the_outbox_holds_the_plaintext_and_late_ones_are_sealed_too(tmp_path: Path) -> None:
    disk = SimDisk(random.Random(1))
    robot = Robot(tmp_path, rule("/secret", "sealed"), disk=disk)
    secret = robot.channel("/secret")
    robot.outbox.online = False
    robot.put(secret, MARKER)
    accept(robot.outbox)
    names = [name for log in LOGS for name in disk.names(log)]
    files = {name: disk.read(name, 0, disk.size(name)) for name in [*names, "ids.log", "state.json"]}
    assert sum(map(len, files.values())) > len(MARKER)
    assert not [name for name, data in files.items() if MARKER in data]
    ((stream, seq, payload),) = robot.sent("bulk_backfill")
    assert stream == secret.channel_id | BACKFILL_BIT
    assert Opener(Keyring.load(robot.path)).open(payload, origin("/secret"), seq=seq).payload == MARKER


def test_a_failed_write_seals_the_samples_again_with_other_nonces(tmp_path: Path) -> None:
    robot = Robot(tmp_path, replace(rule("/secret", "sealed"), delivery="event"))
    secret = robot.channel("/secret")
    robot.put(secret, MARKER)
    first = robot.outbox.flush_job("event")
    assert first is not None
    robot.outbox.refused(first, "disk_error")
    robot.clock.advance(10.0)
    ((_, seq, payload),) = robot.sent("event")
    before = link_pb2.Batch.FromString(first.append.frames[0].body).payload
    assert seq == 1
    assert parse_head(before).nonce != parse_head(payload).nonce
    opened = Opener(Keyring.load(robot.path)).open(payload, origin("/secret"), seq=1)
    assert opened.payload == MARKER


def test_live_and_history_samples_of_a_sealed_topic_are_sealed(tmp_path: Path) -> None:
    robot = Robot(tmp_path, TopicRule(match="/secret", seal="sealed", history_hz=1.0))
    secret = robot.channel("/secret")
    assert secret.copy is not None
    robot.channels.demand({secret.channel_id: 0.0})
    robot.put(secret, MARKER)
    opener = Opener(Keyring.load(robot.path))
    ((stream, (sample,)),) = robot.live.take(1 << 20).items()
    assert stream == secret.channel_id
    assert opener.open(sample.data, origin("/secret"), seq=sample.seq).payload == MARKER
    ((stream, seq, payload),) = robot.sent("bulk")
    assert stream == secret.copy.channel_id
    assert opener.open(payload, origin("/secret"), seq=seq).payload == MARKER
    encodings = {c.channel_id: c.encoding for a in robot.channels.announcements(0) for c in a.channels}
    assert set(encodings.values()) == {"sealed/cdr"}
    assert len(encodings) == 2


@pytest.mark.parametrize(("seal", "series"), [("clear", 1), ("sealed", 0), ("features", 1)])
def test_series_of_a_sealed_topic_leave_the_robot_only_where_the_row_says_features(
    tmp_path: Path, seal: Seal, series: int
) -> None:
    robot = Robot(tmp_path, rule("/battery_state", seal, fields=("percentage",), deadband=0.01))
    battery = robot.channel("/battery_state", "sensor_msgs/msg/BatteryState")
    name = "sensor_msgs/msg/BatteryState"
    robot.put(battery, bytes(codec(name, default_catalogue()).encode(message_class(name)(percentage=0.5))))
    assert len([s for a in robot.channels.announcements(0) for s in a.series]) == series
    assert len(taken(robot.outbox, "metric")) == series
    assert battery.deadband is not None
    assert battery.encoding == ("cdr" if seal == "clear" else "sealed/cdr")


def test_a_topic_that_becomes_sealed_is_another_channel_and_what_waits_stays_what_it_was(tmp_path: Path) -> None:
    disk = SimDisk(random.Random(1))
    before = Robot(tmp_path, rule("/secret", "clear"), disk=disk)
    old = before.channel("/secret")
    before.put(old, b"not secret yet")
    accept(before.outbox)
    after = Robot(tmp_path, rule("/secret", "sealed"), disk=disk, seed=2)
    new = after.channel("/secret")
    after.put(new, MARKER)
    assert new.channel_id != old.channel_id
    encodings = {c.channel_id: c.encoding for a in after.channels.announcements(0) for c in a.channels}
    assert encodings == {old.channel_id: "cdr", new.channel_id: "sealed/cdr"}
    found = {stream: payload for log in ("bulk", "bulk_backfill") for stream, _, payload in after.sent(log)}
    assert found[old.channel_id] == b"not secret yet"
    assert MARKER not in found[new.channel_id]
    again = Robot(tmp_path, rule("/secret", "clear"), disk=disk, seed=3)
    assert again.channel("/secret").encoding == "cdr"
    assert again.channel("/secret").channel_id == old.channel_id
    kept = again.channels.by_id(new.channel_id)
    assert kept is not None
    assert kept.encoding == "sealed/cdr"


def test_a_new_key_seals_within_a_second_without_a_restart_and_a_bad_file_changes_nothing(tmp_path: Path) -> None:
    robot = Robot(tmp_path, rule("/secret", "sealed"))
    secret = robot.channel("/secret")
    old = Keyring.load(robot.path)
    new = old.rotated(SealKey.make(CLOCK))
    keys = []

    def put() -> None:
        robot.put(secret, MARKER)
        ((_, _, payload),) = robot.sent("bulk")
        keys.append(parse_head(payload).key_id)

    put()
    new.save(robot.path)
    put()
    robot.path.write_text("gone wrong")
    put()
    old.save(robot.path)
    put()
    assert keys == [old.current.key_id, new.current.key_id, new.current.key_id, old.current.key_id]


def test_a_sample_that_would_be_too_large_once_sealed_is_a_declared_loss(tmp_path: Path) -> None:
    robot = Robot(tmp_path, rule("/secret", "sealed"))
    secret = robot.channel("/secret")
    robot.put(secret, bytes(LIMITS.sample_bytes - OVERHEAD_BYTES + 1))
    assert secret.dropped == 1
    robot.put(secret, bytes(LIMITS.sample_bytes - OVERHEAD_BYTES))
    ((item),) = [item for item in taken(robot.outbox, "bulk") if item.frame.count == 1 and len(item.frame.body) > 100]
    assert len(link_pb2.Batch.FromString(item.frame.body).payload) == LIMITS.sample_bytes


def test_without_a_keyring_an_agent_that_should_seal_does_not_start(tmp_path: Path) -> None:
    settings = Settings(name="r1", topics=(rule("/secret", "sealed"),))
    with pytest.raises(ConfigError, match="metaros seal key new"):
        open_sealing(settings, tmp_path, CLOCK)
    assert open_sealing(Settings(name="r1"), tmp_path, CLOCK) is None
    Keyring((SealKey.make(CLOCK),)).save(tmp_path / "other.keys")
    assert open_sealing(replace(settings, seal_keyring=tmp_path / "other.keys"), tmp_path, CLOCK) is not None


@pytest.mark.parametrize(
    ("row", "said"),
    [
        ('seal = "maybe"', "seal must be one of clear, sealed, features"),
        ('seal = "sealed"\nfields = ["x"]', 'say seal = "features"'),
        ('seal = "features"', "needs topics"),
    ],
)
def test_a_row_that_would_leak_or_says_nothing_is_refused(tmp_path: Path, row: str, said: str) -> None:
    path = tmp_path / "agent.toml"
    path.write_text(f'[[topics]]\nmatch = "/a"\n{row}\n')
    with pytest.raises(ConfigError, match=said):
        load_settings(path)


def test_rows_that_seal_are_read(tmp_path: Path) -> None:
    path = tmp_path / "agent.toml"
    path.write_text(
        'seal_keyring = "/etc/metaros/seal.keys"\n[[topics]]\nmatch = "/a"\nseal = "sealed"\n'
        '[[topics]]\nmatch = "/b"\nseal = "features"\nfields = ["x"]\n'
    )
    settings = load_settings(path)
    assert [row.seal for row in settings.topics[:3]] == ["sealed", "features", "clear"]
    assert settings.seal_keyring == Path("/etc/metaros/seal.keys")
    assert catalogue_of(TYPE, HASH) is not None


def test_the_black_box_and_its_clips_are_sealed_and_open_with_the_key(tmp_path: Path) -> None:
    robot = Robot(tmp_path, rule("/secret", "sealed"), rule("**", "clear"))
    folder = tmp_path / "ring"
    ring = Ring(
        folder,
        robot.clock,
        window_s=300.0,
        limit_bytes=64 << 20,
        free=lambda: (1 << 40, 1 << 40),
        seal=robot.sealing.recorded,
    )
    publishers = {}
    for topic in ("/secret", "/plain"):
        source = RecordedPublisher(robot.channel(topic), Publisher(topic, TYPE, topic.encode().ljust(16, b"\0")))
        publishers[topic, source.publisher.gid] = source.publisher
        for sequence in (1, 2, 3):
            stamp_ns = robot.clock.wall_ns()
            ring.write(source, sequence, stamp_ns, stamp_ns, MARKER if topic == "/secret" else b"plain")
            robot.clock.advance(1.0)
    span = Span(recording_id="x", from_ns=0, to_ns=robot.clock.wall_ns())
    write_clip(RingSnapshot(ring.hold(), ring.latched_path, publishers), span, tmp_path / "clip.mcap", robot_id="r1")
    files = [*folder.glob("*.mcap"), tmp_path / "clip.mcap"]
    assert len(files) == 2
    assert [path for path in files if any(MARKER in item.data for item in open_bag(path).messages())] == []
    done = unseal(open_bag(tmp_path / "clip.mcap"), tmp_path / "open.mcap", Keyring.load(robot.path))
    assert (done.opened, done.refused) == (3, {})
    read = [(item.topic.name, item.sequence, item.data) for item in open_bag(tmp_path / "open.mcap").messages()]
    assert [item for item in read if item[0] == "/secret"] == [("/secret", n, MARKER) for n in (1, 2, 3)]
    assert [item for item in read if item[0] == "/plain"] == [("/plain", n, b"plain") for n in (1, 2, 3)]


def test_a_sample_whose_channel_nobody_knows_is_dropped_and_never_in_clear(
    tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    disk = SimDisk(random.Random(1))
    robot = Robot(tmp_path, rule("/plain", "clear"), disk=disk)
    robot.put(robot.channel("/plain"), b"plain")
    for unknown in (4711, 4711, 4712):
        robot.outbox.append(unknown, "bulk", 1, MARKER)
    failed = robot.outbox.flush_job("bulk")
    assert failed is not None
    robot.outbox.refused(failed, "disk_error")  # a second try counts them once all the same
    robot.put(robot.channel("/plain"), b"plain")
    robot.outbox.append(4711, "bulk", 1, MARKER)
    accept(robot.outbox)
    assert [payload for _, _, payload in robot.sent("bulk")] == [b"plain"]
    assert not [name for log in LOGS for name in disk.names(log) if MARKER in disk.read(name, 0, disk.size(name))]
    assert (robot.sealing.refused, robot.outbox.lost["bulk"]) == (4, 5)  # and what was on its way to the disk
    assert [record.getMessage()[:26] for record in caplog.records] == ["samples of stream 4711 are"]
