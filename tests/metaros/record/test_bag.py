"""Recordings written, split, cut off, damaged, and read again."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest
from mcap.opcode import Opcode
from mcap.reader import make_reader
from mcap.writer import IndexType, Writer
from rosbags.highlevel import AnyReader

from metaros.errors import ConfigError, RecordingError
from metaros.interfaces.geometry_msgs.msg import Point
from metaros.interfaces.std_msgs.msg import Char, String
from metaros.record import BagOptions, open_bag, rewrite
from tests.support.nodes.bags import START_NS, SmallDisk, arrivals, write_bag
from tests.support.tables import cases


def strings(count: int = 100) -> list:
    return arrivals("/chatter", [String(data=f"hello {n}") for n in range(count)])


def points(count: int = 50) -> list:
    made = [Point(x=float(n), y=0.5, z=-1.0) for n in range(count)]
    return arrivals("/a/point", made, step_ns=20_000_000, offset_ns=5_000_000)


def test_both_readers_of_pypi_agree_with_ours(tmp_path: Path) -> None:
    write_bag(tmp_path / "run", strings(), points())
    bag = open_bag(tmp_path / "run")
    assert [(t.name, t.type_name, t.messages) for t in bag.topics] == [
        ("/a/point", "geometry_msgs/msg/Point", 50),
        ("/chatter", "std_msgs/msg/String", 100),
    ]
    ours = [(m.topic.name, m.log_ns, m.data) for m in bag.messages()]
    assert ours == sorted(ours, key=lambda item: item[1])
    with (tmp_path / "run" / "run_0.mcap").open("rb") as file:
        reader = make_reader(file, validate_crcs=True)
        assert [(c.topic, m.log_time, m.data) for _s, c, m in reader.iter_messages()] == ours
    for place in (tmp_path / "run", tmp_path / "run" / "run_0.mcap"):
        with AnyReader([place]) as reader:
            theirs = [(c.topic, t, raw) for c, t, raw in reader.messages()]
            assert theirs == ours
            c, _t, raw = next(reader.messages(connections=[c for c in reader.connections if c.topic == "/a/point"]))
            assert reader.deserialize(raw, c.msgtype).y == 0.5
    assert [m.decode().data for m in bag.messages(["/chatter"])][:2] == ["hello 0", "hello 1"]


def test_times_and_topics_choose(tmp_path: Path) -> None:
    write_bag(tmp_path / "a.mcap", strings(), points())
    bag = open_bag(tmp_path / "a.mcap")
    start, end = START_NS + 100_000_000, START_NS + 200_000_000
    chosen = list(bag.messages(["chatter"], start_ns=start, end_ns=end))
    assert [message.sequence for message in chosen] == list(range(11, 21))
    assert (bag.first_ns, bag.last_ns, bag.message_count) == (START_NS, START_NS + 990_000_000, 150)


def test_split_by_time_and_size(tmp_path: Path) -> None:
    options = BagOptions(chunk_bytes=500, split_s=0.25)
    assert len(write_bag(tmp_path / "time", strings(), options=options).files) == 4
    options = BagOptions(chunk_bytes=500, split_bytes=3000, compression="none")
    assert len(write_bag(tmp_path / "size", strings(), options=options).files) > 2
    for name in ("time", "size"):
        assert [m.sequence for m in open_bag(tmp_path / name).messages()] == list(range(1, 101))
        with AnyReader([tmp_path / name]) as reader:
            assert reader.message_count == 100
    done = rewrite(open_bag(tmp_path / "time"), tmp_path / "one.mcap")
    assert done.messages == 100
    accounts = open_bag(tmp_path / "one.mcap").gaps()
    assert sum(account["received"] for *_place, account in accounts) == 100


def test_what_cannot_be_recorded_into(tmp_path: Path) -> None:
    write_bag(tmp_path / "a.mcap", strings(3))
    with pytest.raises(ConfigError, match="not overwritten"):
        write_bag(tmp_path / "a.mcap", strings(3))
    with pytest.raises(ConfigError, match="name a folder"):
        write_bag(tmp_path / "b.mcap", strings(3), options=BagOptions(split_s=1))
    with pytest.raises(RecordingError, match="cannot write"):
        write_bag(tmp_path / "a.mcap" / "b", strings(3))


def test_a_killed_recorders_file(tmp_path: Path) -> None:
    write_bag(tmp_path / "whole.mcap", strings(), points())
    whole = (tmp_path / "whole.mcap").read_bytes()
    seen = set()
    for length in range(len(whole) - 1, 100, -97):
        path = tmp_path / "cut.mcap"
        path.write_bytes(whole[:length])
        bag = open_bag(path)
        assert "no index" in bag.files[0].damage
        messages = list(bag.messages())
        seen.add(len(messages))
        assert len(messages) == bag.message_count
        path.unlink()
    assert max(seen) == 150
    assert min(seen) == 0
    assert len(seen) > 3


def test_a_damaged_chunk_is_named_and_passed_over(tmp_path: Path) -> None:
    path = tmp_path / "a.mcap"
    write_bag(path, strings(), options=BagOptions(chunk_bytes=1000, compression="none"))
    bag = open_bag(path)
    chunk = bag.files[0].chunks[1]
    data = bytearray(path.read_bytes())
    data[chunk.chunk_start_offset + chunk.chunk_length - 10] ^= 0xFF
    path.write_bytes(data)
    with pytest.raises(RecordingError, match="damaged"):
        list(open_bag(path).messages())
    reported: list[str] = []
    done = rewrite(open_bag(path), tmp_path / "sound.mcap", damaged=reported.append)
    assert len(reported) == 1
    assert 0 < done.messages < 100
    with (tmp_path / "sound.mcap").open("rb") as file:
        assert sum(1 for _ in make_reader(file, validate_crcs=True).iter_messages()) == done.messages


def test_a_compression_that_nobody_knows_is_named(tmp_path: Path) -> None:
    path = tmp_path / "a.mcap"
    write_bag(path, strings(3))
    path.write_bytes(path.read_bytes().replace(b"\x04\0\0\0zstd", b"\x04\0\0\0zst9"))  # the chunk's and the index's
    bag = open_bag(path)
    assert bag.files[0].damage == ""
    with pytest.raises(RecordingError, match=r"the chunk at byte \d+ is damaged: unknown compression 'zst9'"):
        list(bag.messages())


def test_a_file_whose_end_is_no_footer_is_read_from_its_beginning(tmp_path: Path) -> None:
    path = tmp_path / "a.mcap"
    write_bag(path, strings(3))
    data = bytearray(path.read_bytes())
    assert data[-37] == Opcode.FOOTER
    data[-37] = Opcode.DATA_END  # a sound record of that length, which does not say where the summary is
    path.write_bytes(data)
    bag = open_bag(path)
    assert bag.files[0].damage == "no index: the recorder did not close the file"
    assert [message.sequence for message in bag.messages()] == [1, 2, 3]


@cases(
    ("options", "messages"),
    [
        ({}, 1),
        ({"use_statistics": False}, 1),  # a summary without the counts is none
        (
            {
                "index_types": IndexType.NONE,
                "repeat_channels": False,
                "repeat_schemas": False,
                "use_statistics": False,
                "use_summary_offsets": False,
            },
            1,
        ),  # the file is closed, and has no summary at all
        ({"use_chunking": False}, 0),  # it counts one message, and says of no chunk where that is
    ],
)
def test_a_summary_that_does_not_say_enough_is_not_believed(
    options: dict[str, Any], messages: int, tmp_path: Path
) -> None:
    path = tmp_path / "a.mcap"
    with path.open("wb") as stream:
        writer = Writer(stream, **options)
        writer.start("ros2")
        schema = writer.register_schema("std_msgs/msg/String", "ros2msg", b"string data\n")
        channel = writer.register_channel("/c", "cdr", schema)
        (_arrival, payload), *_rest = strings(1)
        writer.add_message(channel, 5, payload, 4, 1)
        writer.finish()
    bag = open_bag(path)
    assert bag.files[0].damage == ("no index: the recorder did not close the file" if options else "")
    assert [message.decode().data for message in bag.messages()] == ["hello 0"] * messages
    assert bag.message_count == messages


def test_what_is_no_recording(tmp_path: Path) -> None:
    (tmp_path / "a.mcap").write_bytes(b"hello")
    (tmp_path / "empty").mkdir()
    for place, text in (
        (tmp_path / "a.mcap", "no MCAP"),
        (tmp_path / "empty", "no .mcap"),
        (tmp_path / "x", "no such"),
    ):
        with pytest.raises(RecordingError, match=text):
            open_bag(place)


def test_a_file_by_another_writer(tmp_path: Path) -> None:
    path = tmp_path / "a.mcap"
    with path.open("wb") as stream:
        writer = Writer(stream)
        writer.start("ros2")
        schema = writer.register_schema("std_msgs/msg/String", "ros2msg", b"string data\n")
        channel = writer.register_channel("/c", "cdr", schema)
        other = writer.register_channel("/j", "json", 0)
        (_arrival, payload), *_rest = strings(1)
        writer.add_message(channel, 5, payload, 4, 1)
        writer.add_message(other, 6, b"{}", 6, 1)
        writer.finish()
    bag = open_bag(path)
    first, second = bag.messages()
    assert first.decode().data == "hello 0"
    with pytest.raises(RecordingError, match="json"):
        second.decode()
    assert bag.gaps() == []


def test_a_full_disk_ends_the_recording_soundly(tmp_path: Path) -> None:
    options = BagOptions(
        chunk_bytes=1000, compression="none", split_bytes=4000, open_file=lambda path: SmallDisk(path, 3500)
    )
    with pytest.raises(RecordingError, match=r"disk is full\nthe recording ends with \d+ messages; it is closed"):
        write_bag(tmp_path / "run", strings(200), options=options)
    bag = open_bag(tmp_path / "run")
    assert not bag.files[0].damage
    found = [message.sequence for message in bag.messages()]
    ((_path, _topic, _gid, account),) = bag.gaps()
    missing = [n for low, high in account["disk"] for n in range(low, high + 1)]
    assert sorted([*found, *missing]) == list(range(1, account["last"] + 1))
    with AnyReader([tmp_path / "run"]) as reader:
        assert reader.message_count == len(found)


@pytest.mark.parametrize("chunk_bytes", [1 << 20, 1000])
def test_what_does_not_fit_at_the_end_is_an_error(chunk_bytes: int, tmp_path: Path) -> None:
    options = BagOptions(chunk_bytes=chunk_bytes, compression="none", open_file=lambda path: SmallDisk(path, 6000))
    with pytest.raises(RecordingError, match="it is closed and sound"):
        write_bag(tmp_path / "a.mcap", strings(80), options=options)
    bag = open_bag(tmp_path / "a.mcap")
    assert not bag.files[0].damage
    ((_path, _topic, _gid, account),) = bag.gaps()
    assert account["received"] == bag.message_count < 80


def test_rosbags_opens_a_folder_with_a_char(tmp_path: Path) -> None:
    """It computes another hash for that type, which must not keep it from all the others."""
    write_bag(tmp_path / "run", arrivals("/c", [Char(data=65)]), strings(3))
    with AnyReader([tmp_path / "run"]) as reader:
        assert reader.message_count == 4


def test_cutting(tmp_path: Path) -> None:
    write_bag(tmp_path / "a.mcap", strings(), points())
    bag = open_bag(tmp_path / "a.mcap")
    done = rewrite(bag, tmp_path / "b.mcap", topics=["/chatter"], start_s=0.1, duration_s=0.1, compression="lz4")
    piece = open_bag(done.path)
    assert [m.sequence for m in piece.messages()] == list(range(11, 21))
    assert [t.qos for t in piece.topics] == [t.qos for t in bag.topics if t.name == "/chatter"]
    assert [t.type_hash for t in piece.topics] == [t.type_hash for t in bag.topics if t.name == "/chatter"]
    with pytest.raises(ConfigError, match="not overwritten"):
        rewrite(bag, done.path)
    with pytest.raises(ConfigError, match=r"ends in \.mcap"):
        rewrite(bag, tmp_path / "folder")
