"""Frames are told apart by their bytes, and what a gate lets through can be decoded."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from metaros.cdr import codec
from metaros.convert import video_packet
from metaros.interfaces.foxglove_msgs.msg import CompressedVideo
from metaros.link.video_frames import VIDEO_TYPES, Frame, GroupGate, frame_of, is_key
from tests.support.devices.video import COMPRESSED_VIDEO, access_units, key_numbers, pictures, video_message

PACKET = "metaros_msgs/msg/VideoPacket"
UNITS = access_units(24, group=6)
MESSAGES = [video_message(unit) for unit in UNITS]
PICTURES = pictures(MESSAGES)


@pytest.mark.parametrize("frame_id", ["", "c", "ca", "cam", "came", "camera_optical_frame"])
def test_key_frames_of_an_encoder(frame_id: str) -> None:
    found = [n for n, unit in enumerate(UNITS) if is_key(COMPRESSED_VIDEO, video_message(unit, frame_id=frame_id))]
    assert found == key_numbers(UNITS) == [0, 6, 12, 18]


def test_a_packet_says_what_it_is_whatever_its_codec() -> None:
    for key in (True, False):
        packet = video_packet(b"\x12\x34", "av1", pts_ns=1, key_frame=key, frame_id="cam")
        assert is_key(PACKET, codec(PACKET).encode(packet)) is key


def unit_message(*units: int, kind: str = "h264") -> bytes:
    """A message of NAL units of these first bytes."""
    return video_message(b"".join(b"\x00\x00\x01" + bytes([unit]) + b"\x80\x80" for unit in units), kind=kind)


@pytest.mark.parametrize(
    ("units", "kind", "frame"),
    [
        ((0x67, 0x68, 0x65), "h264", Frame.KEY),  # SPS, PPS, IDR
        ((0x09, 0x06, 0x65), "h264", Frame.KEY),  # delimiter, SEI
        ((0x67, 0x68, 0x41), "h264", Frame.DELTA),  # parameter sets in front of every frame
        ((0x41, 0x65), "h264", Frame.DELTA),
        ((0x67, 0x68), "h264", Frame.DELTA),  # no picture
        ((0x40, 0x42, 0x26), "h265", Frame.KEY),  # VPS, SPS, IDR_W_RADL
        ((0x40, 0x2A), "h265", Frame.KEY),  # CRA
        ((0x02,), "h265", Frame.DELTA),
        ((0x65,), "H264", Frame.KEY),
        ((0x65,), "vp9", Frame.ALONE),
        ((), "h264", Frame.DELTA),
    ],
)
def test_the_first_slice_decides(units: tuple[int, ...], kind: str, frame: Frame) -> None:
    assert frame_of(COMPRESSED_VIDEO, unit_message(*units, kind=kind)) is frame


def test_big_endian_messages_are_read_too() -> None:
    text = b"\x00\x01\x00\x00" + bytes(8) + b"\x00\x00\x00\x01\x00" + bytes(3)
    text += b"\x00\x00\x00\x05\x00\x00\x01\x65\x80" + bytes(3) + b"\x00\x00\x00\x05h264\x00"
    text = b"\x00\x00" + text[2:]
    assert frame_of(COMPRESSED_VIDEO, text) is Frame.KEY


def test_what_stands_before_the_first_slice_is_searched_within_bounds() -> None:
    assert frame_of(COMPRESSED_VIDEO, video_message(bytes(1 << 20) + b"\x00\x00\x01\x65")) is Frame.DELTA
    assert frame_of(COMPRESSED_VIDEO, unit_message(*[0x06] * 1000, 0x65)) is Frame.DELTA


@settings(max_examples=50)
@given(st.binary(max_size=300), st.sampled_from(sorted(VIDEO_TYPES)))
def test_garbage_is_some_frame(garbage: bytes, type_name: str) -> None:
    assert frame_of(type_name, garbage) in Frame
    cut = MESSAGES[0][: len(garbage)]
    assert frame_of(COMPRESSED_VIDEO, cut) in Frame


@given(st.binary(max_size=300))
def test_garbage_in_a_sound_message_is_some_frame(garbage: bytes) -> None:
    message = CompressedVideo(data=np.frombuffer(garbage, np.uint8), format="h264")
    assert frame_of(COMPRESSED_VIDEO, codec(COMPRESSED_VIDEO).encode(message)) in {Frame.KEY, Frame.DELTA}


def passed(lost: set[int], *, skipped: set[int] | None = None) -> list[int]:
    """Which of the messages a gate lets through where some never came, and it was told to leave some out."""
    gate, found = GroupGate(), []
    for number, message in enumerate(MESSAGES):
        if number in lost:
            continue
        if number in (skipped or set()):
            gate.lost()
        elif gate.admit(frame_of(COMPRESSED_VIDEO, message), number):
            found.append(number)
    return found


@settings(deadline=None, max_examples=40)
@given(st.sets(st.integers(0, 23)), st.sets(st.integers(0, 23)))
def test_whatever_is_lost_what_passes_can_be_decoded(lost: set[int], skipped: set[int]) -> None:
    found, keys = passed(lost, skipped=skipped), set(key_numbers(UNITS))
    assert all(number in keys or number - 1 in found for number in found)
    assert keys - lost - skipped <= set(found)
    assert pictures(MESSAGES[number] for number in found) == [PICTURES[number] for number in found]


def test_the_pictures_tell_when_a_frame_was_left_out() -> None:
    without = [number for number in range(24) if number != 3]
    assert pictures(MESSAGES[number] for number in without) != [PICTURES[number] for number in without]


def test_nothing_is_lost_where_nothing_is_missing() -> None:
    assert passed(set()) == list(range(24))
    assert passed({3}) == [0, 1, 2, *range(6, 24)]
    assert passed({6, 12}) == [*range(6), *range(18, 24)]
