"""What was recorded is what is heard: names, types, hashes, QoS, bytes, stamps."""

from __future__ import annotations

import threading
from pathlib import Path
from queue import SimpleQueue

import pytest
import zenoh
from mcap.writer import Writer

import metaros
from metaros.clock import SystemClock
from metaros.errors import ConfigError, RecordingError
from metaros.interfaces.rosgraph_msgs.msg import Clock
from metaros.interfaces.std_msgs.msg import String
from metaros.record import Player, open_bag
from metaros.wire import parse_attachment
from tests.support.nodes.bags import START_NS, arrivals, write_bag
from tests.support.waiting import wait_until

WAIT_S = 60.0


@pytest.fixture
def bag(tmp_path: Path) -> Path:
    write_bag(tmp_path / "a.mcap", arrivals("/chatter", [String(data=f"hello {n}") for n in range(100)]))
    return tmp_path / "a.mcap"


class Ears:
    """Everything on one topic, unread."""

    def __init__(self, context: metaros.Context, topic: str, message_type: type = String) -> None:
        self.node = metaros.Node("ears", context=context, enable_rosout=False, enable_parameters=False)
        self.queue: SimpleQueue[zenoh.Sample] = SimpleQueue()
        code = metaros.cdr.codec(message_type)
        self.node.create_raw_subscription(topic, code.name, code.hash, 1000, self.queue.put)

    def wait(self, count: int) -> list[zenoh.Sample]:
        wait_until(lambda: self.queue.qsize() >= count, timeout_s=WAIT_S)
        return [self.queue.get() for _ in range(self.queue.qsize())]


def play(player: Player, ears: Ears, **options: object) -> None:
    """Once both sides know each other."""
    wait_until(lambda: ears.node.graph.endpoints(topic=player.topics[0], kind="MP"), timeout_s=WAIT_S)
    player.play(wait_subscriber_s=WAIT_S, **options)


def test_bytes_and_stamps(bag: Path, contexts: tuple) -> None:
    ears = Ears(contexts[0], "/chatter")
    with Player(contexts[1], bag, rate=0.0, keep_stamps=True) as player:
        play(player, ears)
        received = ears.wait(100)
        (end,) = ears.node.graph.endpoints(topic="/chatter", kind="MP")
    recorded = list(open_bag(bag).messages())
    assert [sample.payload.to_bytes() for sample in received] == [message.data for message in recorded]
    stamps = [parse_attachment(sample.attachment.to_bytes()).source_ns for sample in received]
    assert stamps == [message.publish_ns for message in recorded]
    assert end.type_hash == recorded[0].topic.type_hash
    assert [end.qos] == recorded[0].topic.qos
    assert player.report().messages == 100


def test_a_piece_under_another_name_again_and_again(bag: Path, contexts: tuple) -> None:
    ears, stop = Ears(contexts[0], "/other"), threading.Event()
    options = {"start_s": 0.5, "duration_s": 0.1, "remap": {"/chatter": "/other"}, "loop": True}
    with Player(contexts[1], bag, rate=0.0, **options) as player:
        thread = threading.Thread(target=play, args=(player, ears), kwargs={"stop": stop})
        thread.start()
        try:
            received = ears.wait(25)
        finally:
            stop.set()
            thread.join()
    texts = [sample.payload.to_bytes()[8:-1].decode() for sample in received[:20]]
    assert texts == [f"hello {n}" for n in range(50, 60)] * 2


def test_time_goes_at_its_rate_and_stands_in_a_pause(bag: Path, contexts: tuple) -> None:
    ears, clock = Ears(contexts[0], "/chatter"), SystemClock()
    with Player(contexts[1], bag, rate=4.0) as player:
        player.pause()
        reports: list = []
        thread = threading.Thread(target=play, args=(player, ears), kwargs={"on_progress": reports.append})
        thread.start()
        try:
            wait_until(lambda: any(report.paused for report in reports), timeout_s=WAIT_S)
            assert player.report().messages <= 1
            begin_s = clock.monotonic_s()
        finally:
            player.resume()
            thread.join()
        assert clock.monotonic_s() - begin_s >= 0.2  # 0.99 s at fourfold, never faster
        assert player.report().messages == 100


def test_the_recordings_clock(bag: Path, contexts: tuple) -> None:
    ears = Ears(contexts[0], "/clock", Clock)
    with Player(contexts[1], bag, rate=0.0, clock_hz=10.0) as player:
        wait_until(lambda: ears.node.graph.endpoints(topic="/clock", kind="MP"), timeout_s=WAIT_S)
        wait_until(lambda: player._node.graph.endpoints(topic="/clock", kind="MS"), timeout_s=WAIT_S)
        player.play(wait_subscriber_s=0.0)
        decode = metaros.cdr.codec(Clock).decode
        times = [decode(sample.payload.to_bytes()).clock for sample in ears.wait(10)]
    assert times[0].sec * 10**9 + times[0].nanosec == START_NS
    assert [t.sec * 10**9 + t.nanosec for t in times] == [START_NS + n * 10**8 for n in range(10)]


def test_topics_that_are_no_cdr(contexts: tuple, tmp_path: Path) -> None:
    with (tmp_path / "a.mcap").open("wb") as stream:
        writer = Writer(stream)
        writer.start("ros2")
        writer.add_message(writer.register_channel("/j", "json", 0), 6, b"{}", 6, 1)
        writer.finish()
    with pytest.raises(RecordingError, match="/j is not encoded as CDR"):
        Player(contexts[1], tmp_path / "a.mcap")


def test_what_cannot_be_played(bag: Path, contexts: tuple) -> None:
    for options, error, text in (
        ({"rate": -1.0}, ConfigError, "rate"),
        ({"start_s": -1.0}, ConfigError, "start"),
        ({"topics": ["/nothing"]}, RecordingError, "no message"),
        ({"remap": {"/x": "/y"}}, ConfigError, "remap /x"),
    ):
        with pytest.raises(error, match=text):
            Player(contexts[1], bag, **options)
