"""What ZeroMQ programs write, read apart; and whatever they write is read or refused, nothing else."""

from __future__ import annotations

from contextlib import suppress

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from metaros.broker.frames import join, parse_payload, ros_topic, split
from metaros.errors import FrameError


@pytest.mark.parametrize(
    ("frames", "expected"),
    [
        ([b'/chatter {"data": "a b"}'], (b"/chatter", b'{"data": "a b"}')),
        ([b"temperature 21.5"], (b"temperature", b"21.5")),
        ([b"/empty "], (b"/empty", b"")),
        ([b"/two", b"frames with spaces"], (b"/two", b"frames with spaces")),
    ],
)
def test_split(frames: list[bytes], expected: tuple[bytes, bytes]) -> None:
    assert split(frames) == expected
    assert join(*expected, two_frames=len(frames) == 2) == frames


@pytest.mark.parametrize("frames", [[b"/alone"], [b" leading"], [b""], [b"a", b"b", b"c"]])
def test_what_is_no_message(frames: list[bytes]) -> None:
    with pytest.raises(FrameError):
        split(frames)


def test_topics_get_their_slash_and_must_be_ros_names() -> None:
    assert ros_topic(b"temperature") == "/temperature"
    assert ros_topic(b"/arm/joint_1") == "/arm/joint_1"
    for topic in (b"", b"/", b"a.b", b"/a//b", b"//a", b"1st", b"\xff", b"x" * 300):
        with pytest.raises(FrameError, match="ROS name"):
            ros_topic(topic)


@pytest.mark.parametrize(
    ("payload", "value"),
    [
        (b'{"data": 1}', {"data": 1}),
        (b"21.5", 21.5),
        (b"true", True),
        (b"hello world", "hello world"),
        ("grüße".encode(), "grüße"),
        (b"\xff\x00", b"\xff\x00"),
        (b"\xfe\xff\x00a", b"\xfe\xff\x00a"),
        (b"", ""),
    ],
)
def test_payloads(payload: bytes, value: object) -> None:
    assert parse_payload(payload) == value


@pytest.mark.parametrize("payload", [b"{", b' {"a": }', b"[1, 2", b"[" * 100_000, b'{"a": ' + b"9" * 5000 + b"}"])
def test_broken_json_is_refused(payload: bytes) -> None:
    with pytest.raises(FrameError, match="no JSON"):
        parse_payload(payload)


@settings(max_examples=50)
@given(st.lists(st.binary(max_size=50), min_size=1, max_size=3))
def test_any_bytes_are_read_or_refused(frames: list[bytes]) -> None:
    with suppress(FrameError):
        topic, payload = split(frames)
        assert ros_topic(topic).isprintable()
        parse_payload(payload)
