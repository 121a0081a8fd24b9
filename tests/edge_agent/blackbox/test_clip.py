"""A clip: every message of its span with the robot's stamps, what late joiners need, and an account of all else."""

from __future__ import annotations

import errno
import hashlib
import json
import os
import warnings
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import pytest
from mcap.reader import make_reader
from rosbags.rosbag2.storage_mcap import McapReader

from edge_agent.blackbox.clip import Clip, Span, write_clip
from edge_agent.errors import DiskFullError, NothingRecordedError
from metaros.idl import catalogue_of, schema_text, type_hash
from tests.edge_agent.blackbox.rig import SECOND, STRING, RingRig, read_clip, text

MakeRig = Callable[..., RingRig]
ID = "01HZZZZZZZZZZZZZZZZZZZZZZZ"


def span(from_ns: int, to_ns: int, *topics: str) -> Span:
    return Span(recording_id=ID, from_ns=from_ns, to_ns=to_ns, topics=topics)


def clip_of(rig: RingRig, wanted: Span, path: Path) -> Clip:
    held = rig.held()
    try:
        return write_clip(held, wanted, path, robot_id="r1")
    finally:
        rig.ring.release()


def gaps(path: Path) -> dict[str, dict[str, object]]:
    with path.open("rb") as file:
        record = next(m for m in make_reader(file).iter_metadata() if m.name == "metaros.gaps")
    return {key.split(" ")[0]: json.loads(said) for key, said in record.metadata.items()}


def test_every_message_of_the_span_and_none_else(make_rig: MakeRig, tmp_path: Path) -> None:
    rig = make_rig(tmp_path / "ring")
    for _ in range(4):
        rig.run(10)
        rig.run(1, topic="/scan", size_bytes=2000)
    begin = rig.written[0][2]
    wanted = span(begin + 8 * SECOND, begin + 31 * SECOND)
    clip = clip_of(rig, wanted, tmp_path / "clip.mcap")
    expected = [message for message in rig.written if wanted.from_ns <= message[2] <= wanted.to_ns]
    assert read_clip(tmp_path / "clip.mcap") == expected
    assert len(expected) > 200
    assert (clip.messages, clip.from_ns, clip.to_ns) == (len(expected), wanted.from_ns, wanted.to_ns)
    data = (tmp_path / "clip.mcap").read_bytes()
    assert (clip.size_bytes, clip.sha256) == (len(data), hashlib.sha256(data).digest())
    accounts = gaps(tmp_path / "clip.mcap")
    assert set(accounts) == {"/odom", "/scan"}
    assert not any("lost" in account or "dropped" in account for account in accounts.values())


def test_it_is_a_bag_that_other_readers_open(make_rig: MakeRig, tmp_path: Path) -> None:
    rig = make_rig(tmp_path / "ring")
    for word in ("one", "two", "three"):
        rig.put("/chatter", text(word))
        rig.clock.advance(1.0)
    first = rig.written[0][2]
    clip_of(rig, span(0, first + 60 * SECOND), tmp_path / "clip.mcap")
    with (tmp_path / "clip.mcap").open("rb") as file:
        reader = make_reader(file)
        summary = reader.get_summary()
        assert summary is not None
        assert reader.get_header().profile == "ros2"
        (channel,), (schema,) = summary.channels.values(), summary.schemas.values()
        about = next(m.metadata for m in reader.iter_metadata() if m.name == "metaros.recording")
    assert (channel.topic, channel.message_encoding) == ("/chatter", "cdr")
    assert channel.metadata["topic_type_hash"] == type_hash(STRING)
    assert set(channel.metadata) == {"offered_qos_profiles", "topic_type_hash", "type_hash"}
    catalogue = catalogue_of(STRING, type_hash(STRING))
    assert catalogue is not None
    assert (schema.name, schema.encoding) == (STRING, "ros2msg")
    assert schema.data == schema_text(STRING, catalogue).encode()
    assert (about["robot"], about["asked_from_ns"], about["from_ns"]) == ("r1", "0", str(first))
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", ResourceWarning)
        bag = McapReader(tmp_path / "clip.mcap")
        bag.open()
        found = [bytes(data) for _connection, _stamp, data in bag.messages(bag.connections)]
        bag.close()
    assert found == [text("one"), text("two"), text("three")]


def test_the_last_samples_of_latched_topics_come_first(make_rig: MakeRig, tmp_path: Path) -> None:
    rig = make_rig(tmp_path / "ring", window_s=30.0)
    rig.put("/tf_static", b"long ago", latched=True)
    rig.put("/map", b"old map", latched=True)
    rig.clock.advance(0.1)
    rig.put("/map", b"newer map", latched=True)
    rig.run(120)
    assert rig.ring.latched_path.exists(), "what left the ring is kept"
    rig.put("/map", b"newest map, within the ring", latched=True)
    rig.run(8)
    rig.open()  # another process knows it, too
    begin = rig.clock.wall_ns()
    rig.run(3)
    clip = clip_of(rig, span(begin, begin + 10 * SECOND), tmp_path / "clip.mcap")
    found = read_clip(tmp_path / "clip.mcap")
    assert [message[4] for message in found[:2]] == [b"long ago", b"newest map, within the ring"]
    assert {message[0] for message in found[2:]} == {"/odom"}
    assert (clip.messages, clip.from_ns) == (len(found), begin)
    assert len(found) == 2 + 30
    before = clip_of(rig, span(begin - 20 * SECOND, begin - 15 * SECOND), tmp_path / "before.mcap")
    assert [message[4] for message in read_clip(tmp_path / "before.mcap")[:2]] == [b"long ago", b"newer map"]
    assert before.messages == 2 + 51


def test_what_is_missing_is_reported_with_its_reason(make_rig: MakeRig, tmp_path: Path) -> None:
    rig = make_rig(tmp_path / "ring")
    rig.run(2)
    source = rig.source("/odom")
    source.publisher.refuse(21, "dropped")
    source.publisher.refuse(22, "disk")
    rig.sequences["/odom"] = 25  # 23 to 25 never came
    rig.run(1)
    clip_of(rig, span(0, 1 << 62), tmp_path / "clip.mcap")
    account = gaps(tmp_path / "clip.mcap")["/odom"]
    assert (account["first"], account["last"], account["received"]) == (1, 35, 30)
    assert (account["dropped"], account["disk"], account["lost"]) == ([[21, 21]], [[22, 22]], [[23, 25]])


def test_topics_are_patterns_and_nothing_of_them_is_said(make_rig: MakeRig, tmp_path: Path) -> None:
    rig = make_rig(tmp_path / "ring")
    rig.run(2)
    rig.run(2, topic="/front/scan")
    clip_of(rig, span(0, 1 << 62, "**/scan"), tmp_path / "clip.mcap")
    assert {message[0] for message in read_clip(tmp_path / "clip.mcap")} == {"/front/scan"}
    for wanted in (span(0, 1 << 62, "/no/such"), span(0, 5), span(1 << 62, 1 << 62)):
        with pytest.raises(NothingRecordedError):
            clip_of(rig, wanted, tmp_path / "none.mcap")
        assert not (tmp_path / "none.mcap").exists()


def test_a_schema_that_became_known_later_holds_for_all_of_it(make_rig: MakeRig, tmp_path: Path) -> None:
    rig = make_rig(tmp_path / "ring")
    source = rig.source("/hand", type_name="far_robot/msg/Hand", hash_text="RIHS01_" + "7" * 64)
    assert source.channel.schema == b""
    rig.run(12, topic="/hand")
    source.channel.schema = b"float32 angle"
    rig.run(12, topic="/hand")
    clip_of(rig, span(0, 1 << 62), tmp_path / "clip.mcap")
    with (tmp_path / "clip.mcap").open("rb") as file:
        summary = make_reader(file).get_summary()
        assert summary is not None
    assert [schema.data for schema in summary.schemas.values()] == [b"float32 angle"]
    assert len(read_clip(tmp_path / "clip.mcap")) == 240


def test_two_publishers_of_a_topic_share_a_channel_and_have_an_account_each(make_rig: MakeRig, tmp_path: Path) -> None:
    rig = make_rig(tmp_path / "ring")
    rig.run(1, topic="/a")
    other = rig.source("/b")
    other.channel, other.publisher.topic = rig.source("/a").channel, "/a"
    rig.run(1, topic="/b")
    clip_of(rig, span(0, 1 << 62), tmp_path / "clip.mcap")
    with (tmp_path / "clip.mcap").open("rb") as file:
        reader = make_reader(file)
        summary = reader.get_summary()
        assert summary is not None
        accounts = next(m.metadata for m in reader.iter_metadata() if m.name == "metaros.gaps")
    assert len(summary.channels) == 1
    assert len(accounts) == 2
    assert all(json.loads(said)["received"] == 10 for said in accounts.values())


def test_a_damaged_chunk_is_a_gap_and_the_rest_is_there(make_rig: MakeRig, tmp_path: Path) -> None:
    rig = make_rig(tmp_path / "ring")
    rig.run(9)
    rig.ring.close_file()
    (path,) = rig.files()
    data = bytearray(path.read_bytes())
    data[len(data) // 2] ^= 0xFF
    path.write_bytes(data)
    clip_of(rig, span(0, 1 << 62), tmp_path / "clip.mcap")
    account = gaps(tmp_path / "clip.mcap")["/odom"]
    assert account["received"] == 80
    assert account["lost"] == [[41, 50]] or account["lost"] == [[51, 60]]


def test_a_disk_that_fills_up_leaves_no_file(
    make_rig: MakeRig, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    rig = make_rig(tmp_path / "ring")
    rig.run(5)

    def no_space(_descriptor: int) -> None:
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    monkeypatch.setattr("edge_agent.blackbox.clip.os.fsync", no_space)
    with pytest.raises(DiskFullError):
        clip_of(rig, span(0, 1 << 62), tmp_path / "clip.mcap")
    assert not (tmp_path / "clip.mcap").exists()


def test_who_is_asked_now_and_then_can_end_it(make_rig: MakeRig, tmp_path: Path) -> None:
    rig = make_rig(tmp_path / "ring")
    rig.run(5)

    def full() -> None:
        raise DiskFullError("nearly full")

    with pytest.raises(DiskFullError):
        write_clip(rig.held(), replace(span(0, 1 << 62)), tmp_path / "clip.mcap", robot_id="r", check=full)
    assert not (tmp_path / "clip.mcap").exists()
