"""The recorder beside real nodes on a real router."""

from __future__ import annotations

import json
import threading
from functools import partial
from pathlib import Path

import pytest

import metaros
from metaros.errors import ClosedError, ConfigError, RecordingError
from metaros.interfaces.std_msgs.msg import String
from metaros.interfaces.std_srvs.srv import Trigger
from metaros.record import BagOptions, Recorder, RingOptions, open_bag, tap
from metaros.record.schemas import find_schema
from metaros.wire import qos_reliable_all, qos_transient_local
from tests.support.nodes.bags import SmallDisk
from tests.support.processes.threads import left_behind, threads_now
from tests.support.waiting import wait_until

WAIT_S = 60.0


class Talker:
    """A publisher that is heard: it publishes once its subscription is in its graph."""

    def __init__(self, context: metaros.Context, topic: str = "/chatter", qos: object = qos_reliable_all) -> None:
        self.node = metaros.Node("talker", context=context, enable_rosout=False, enable_parameters=False)
        self.publisher = self.node.create_publisher(String, topic, qos)
        self.count = 0

    def wait_received(self) -> None:
        topic, graph = self.publisher.topic, self.node.graph
        wait_until(lambda: graph.endpoints(topic=topic, kind="MS"), timeout_s=WAIT_S)

    def say(self, count: int, *, size: int = 20) -> None:
        for _ in range(count):
            self.count += 1
            self.publisher.publish(String(data=f"{self.count} ".ljust(size, "x")))


def said(path: Path) -> list[int]:
    return [int(message.decode().data.split()[0]) for message in open_bag(path).messages(["/chatter"])]


def account(path: Path) -> dict:
    ((_path, _topic, _gid, found),) = open_bag(path).gaps()
    return found


def test_everything_is_recorded(contexts: tuple, tmp_path: Path) -> None:
    before = threads_now()
    talker = Talker(contexts[0])
    with Recorder(contexts[1], tmp_path / "run", topics=["/chatter"]) as recorder:
        talker.wait_received()
        talker.say(500)
        wait_until(lambda: recorder.report().received == 500, timeout_s=WAIT_S)
    assert said(tmp_path / "run") == list(range(1, 501))
    found = account(tmp_path / "run")
    assert (found["first"], found["last"], found["received"]) == (1, 500, 500)
    assert recorder.report().missing == {}
    assert (tmp_path / "run" / "metadata.yaml").exists()
    assert left_behind(before, "metaros-record") == []
    with pytest.raises(ClosedError):
        recorder.save()


def test_topics_that_come_later_and_those_not_wanted(contexts: tuple, tmp_path: Path) -> None:
    with Recorder(contexts[1], tmp_path / "run", topics=["**"], exclude=["/secret"]) as recorder:
        talker, secret = Talker(contexts[0]), Talker(contexts[0], "/secret")
        talker.wait_received()
        talker.say(10)
        secret.say(10)
        wait_until(lambda: recorder.report().received == 10, timeout_s=WAIT_S)
    assert [topic.name for topic in open_bag(tmp_path / "run").topics] == ["/chatter"]


def test_latched_samples_are_recorded_with_their_qos(contexts: tuple, tmp_path: Path) -> None:
    talker = Talker(contexts[0], qos=qos_transient_local)
    talker.say(3)
    with Recorder(contexts[1], tmp_path / "a.mcap", topics=["/chatter"]) as recorder:
        wait_until(lambda: recorder.report().received >= 1, timeout_s=WAIT_S)
    assert said(tmp_path / "a.mcap") == [3]
    assert open_bag(tmp_path / "a.mcap").topics[0].qos == [qos_transient_local]
    assert account(tmp_path / "a.mcap")["before"] == 2


def test_pause_split_and_services(contexts: tuple, tmp_path: Path) -> None:
    talker = Talker(contexts[0])
    client_node = metaros.Node("operator", context=contexts[0], enable_rosout=False, enable_parameters=False)

    def ask(name: str) -> Trigger.Response:
        with client_node.create_client(Trigger, f"/metaros_recorder/{name}") as client:
            assert client.wait_for_service(WAIT_S)
            return client.call(Trigger.Request(), timeout_s=WAIT_S)

    with Recorder(contexts[1], tmp_path / "run", topics=["/chatter"]) as recorder:
        talker.wait_received()
        talker.say(5)
        wait_until(lambda: recorder.report().written == 5, timeout_s=WAIT_S)
        assert ask("pause").success
        talker.say(5)
        wait_until(lambda: recorder.report().received == 10, timeout_s=WAIT_S)
        assert ask("resume").success
        assert ask("split").success
        talker.say(5)
        wait_until(lambda: recorder.report().written == 10, timeout_s=WAIT_S)
        assert ask("save").message == str(tmp_path / "run")
    assert said(tmp_path / "run") == [1, 2, 3, 4, 5, 11, 12, 13, 14, 15]
    first, second = open_bag(tmp_path / "run").gaps()
    assert (first[3]["last"], second[3]["first"], second[3]["paused"]) == (5, 6, [[6, 10]])
    assert recorder.report().missing == {"/chatter": {"paused": 5}}


class SlowDisk(SmallDisk):
    """A disk that stands still until it is let go."""

    def __init__(self, path: Path, go: threading.Event) -> None:
        super().__init__(path, 1 << 40)
        self.go = go

    def write(self, data: object) -> int:
        if self.tell() > 5000:
            self.go.wait(WAIT_S)
        return super().write(data)


def test_a_slow_disk_drops_at_the_bound_and_says_so(contexts: tuple, tmp_path: Path) -> None:
    go = threading.Event()
    options = BagOptions(chunk_bytes=3000, compression="none", open_file=lambda path: SlowDisk(path, go))
    talker = Talker(contexts[0])
    recorder = Recorder(contexts[1], tmp_path / "run", topics=["/chatter"], options=options, queue_bytes=100_000)
    try:
        talker.wait_received()
        talker.say(300, size=1000)
        wait_until(lambda: recorder.report().received == 300, timeout_s=WAIT_S)
        report = recorder.report()
        assert report.dropped > 100
        assert report.waiting_bytes <= 100_000
    finally:
        go.set()
        report = recorder.close()
    assert report.missing == {"/chatter": {"dropped": report.dropped}}
    missing = [n for low, high in account(tmp_path / "run")["dropped"] for n in range(low, high + 1)]
    assert sorted([*said(tmp_path / "run"), *missing]) == list(range(1, 301))


def test_a_full_disk_ends_it(contexts: tuple, tmp_path: Path) -> None:
    options = BagOptions(chunk_bytes=2000, compression="none", open_file=lambda path: SmallDisk(path, 8000))
    talker = Talker(contexts[0])
    recorder = Recorder(contexts[1], tmp_path / "run", topics=["/chatter"], options=options)
    talker.wait_received()
    talker.say(100, size=1000)
    assert recorder.ended.wait(WAIT_S)
    with pytest.raises(RecordingError, match="disk is full"):
        recorder.split()
    with pytest.raises(RecordingError, match="disk is full"):
        recorder.close()
    found = said(tmp_path / "run")
    assert found == list(range(1, len(found) + 1))
    assert 0 < len(found) < 8


def test_the_ring_is_saved_when_asked(contexts: tuple, tmp_path: Path) -> None:
    talker = Talker(contexts[0])
    ring = RingOptions(window_s=60.0, limit_bytes=30_000)
    with Recorder(contexts[1], tmp_path / "box", topics=["/chatter"], ring=ring) as recorder:
        talker.wait_received()
        talker.say(100, size=1000)
        wait_until(lambda: recorder.report().received == 100, timeout_s=WAIT_S)
        assert recorder.report().size_bytes <= 30_000
        assert not (tmp_path / "box").exists()
        first = recorder.save()
        talker.say(10, size=1000)
        wait_until(lambda: recorder.report().received == 110, timeout_s=WAIT_S)
        second = recorder.save()
        with pytest.raises(ConfigError, match="ring"):
            recorder.split()
    assert said(first)[-1] == 100
    assert said(second)[-1] == 110
    found = account(second)
    assert found["received"] == len(said(second))
    assert not set(found) & {"lost", "dropped"}


def test_a_type_that_only_its_publisher_knows(contexts: tuple, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """No node to ask: recorded without a schema, and told."""
    monkeypatch.setattr(tap, "find_schema", partial(find_schema, timeout_s=0.1))
    node = metaros.Node("strange", context=contexts[0], enable_rosout=False, enable_parameters=False)
    publisher = node.create_raw_publisher("/strange", "my_pkg/msg/Strange", "RIHS01_" + "0" * 64, qos_reliable_all)
    reported: list[str] = []
    with Recorder(contexts[1], tmp_path / "run", topics=["/strange"], notice=reported.append) as recorder:
        wait_until(lambda: node.graph.endpoints(topic="/strange", kind="MS"), timeout_s=WAIT_S)
        for number in range(5):
            publisher.publish(b"\x00\x01\x00\x00" + bytes([number]))
        wait_until(lambda: recorder.report().received == 5 and reported, timeout_s=WAIT_S)
    (topic,) = open_bag(tmp_path / "run").topics
    assert (topic.type_name, topic.schema, topic.messages) == ("my_pkg/msg/Strange", "", 5)
    assert "no schema for my_pkg/msg/Strange" in reported[0]


def test_what_cannot_be_recorded(contexts: tuple, tmp_path: Path) -> None:
    before = threads_now()
    with pytest.raises(ConfigError, match="no topic"):
        Recorder(contexts[1], tmp_path / "a", topics=[])
    with pytest.raises(ConfigError, match="ring"):
        Recorder(contexts[1], tmp_path / "a", topics=["**"], ring=RingOptions(window_s=0.0))
    (tmp_path / "there").mkdir()
    with pytest.raises(ConfigError, match="not overwritten"):
        Recorder(contexts[1], tmp_path / "there", topics=["**"])
    assert left_behind(before, "metaros-record") == []


def test_the_account_is_json_for_others(contexts: tuple, tmp_path: Path) -> None:
    talker = Talker(contexts[0])
    with Recorder(contexts[1], tmp_path / "a.mcap", topics=["/chatter"]) as recorder:
        talker.wait_received()
        talker.say(1)
        wait_until(lambda: recorder.report().received == 1, timeout_s=WAIT_S)
    metadata = dict(open_bag(tmp_path / "a.mcap").files[0].metadata)
    ((key, text),) = metadata["metaros.gaps"].items()
    assert key == f"/chatter {talker.publisher.gid.hex()}"
    assert json.loads(text)["received"] == 1
