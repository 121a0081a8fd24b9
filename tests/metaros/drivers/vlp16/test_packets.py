"""VLP-16 packets to points: geometry, times and returns, against a loop written from the manual."""

from __future__ import annotations

import math
import struct

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from metaros.drivers.vlp16.packets import DUAL, ELEVATIONS_DEG, POINT_DTYPE, packet_problem
from metaros.drivers.vlp16.position import parse_position
from metaros.drivers.vlp16.revolutions import MAX_PACKETS, RawRevolution, RevolutionSplitter, decode
from tests.support.devices.room import AHEAD_M, BEHIND_M, LEFT_M, RIGHT_M
from tests.support.devices.vlp16_emulator import FLOOR_M, Vlp16Emulator, position_packet

SECOND = 1_000_000_000


def cut(packets: list[bytes], cutter: RevolutionSplitter | None = None) -> list[RawRevolution]:
    """The turns of packets that arrive by their own clock, 100 µs late."""
    cutter = cutter or RevolutionSplitter()
    found = []
    for data in packets:
        (us,) = struct.unpack_from("<I", data, 1200)
        turn = cutter.add(data, us * 1000 + 1_327_104 + 100_000)
        if turn is not None:
            found.append(turn)
    return found


def by_the_manual(data: bytes) -> list[tuple[float, float, float, int, float]]:
    """x, y, z, laser and µs of every return of one packet in single mode, one after the other."""
    points = []
    azimuths = [struct.unpack_from("<H", data, 100 * block + 2)[0] for block in range(12)]
    for block in range(12):
        following = azimuths[block + 1] if block < 11 else azimuths[block] + azimuths[11] - azimuths[10]
        gap = (following - azimuths[block]) % 36000
        for channel in range(32):
            distance, _ = struct.unpack_from("<HB", data, 100 * block + 4 + 3 * channel)
            firing, laser = divmod(channel, 16)
            us = 55.296 * firing + 2.304 * laser
            azimuth = math.radians((azimuths[block] + gap * us / 110.592) / 100)
            elevation = math.radians(ELEVATIONS_DEG[laser])
            flat = distance * 0.002 * math.cos(elevation)
            x, y, z = flat * math.cos(azimuth), -flat * math.sin(azimuth), distance * 0.002 * math.sin(elevation)
            points.append((x, y, z, laser, 110.592 * block + us))
    return points


def test_points_are_where_a_loop_by_the_manual_has_them() -> None:
    data = Vlp16Emulator(azimuth_deg=100).packet()
    points = decode(RawRevolution(packets=data, us=(0,), first=0, last=12, stamp_ns=0, mode=0x37))
    expected = by_the_manual(data)
    assert len(points) == len(expected) == 384
    for point, (x, y, z, laser, us) in zip(points, expected, strict=True):
        assert math.hypot(point["x"] - x, point["y"] - y) < 0.002
        assert point["z"] == pytest.approx(z, abs=0.0113)  # the lasers are not at one height
        assert point["time"] == pytest.approx(us * 1e-6, abs=1e-9)
        assert point["ring"] == sorted(ELEVATIONS_DEG).index(ELEVATIONS_DEG[laser])
        assert point["intensity"] == 10 + laser


def test_a_turn_is_the_room() -> None:
    (turn, *_) = cut(list(Vlp16Emulator().turns(2.6)))
    points = decode(turn)
    assert len(points) == pytest.approx(28_930, abs=100)
    level = points[points["ring"] == 8]  # 1 degree
    assert level["x"].max() == pytest.approx(AHEAD_M, abs=0.01)
    assert level["x"].min() == pytest.approx(-BEHIND_M, abs=0.01)
    assert level["y"].max() == pytest.approx(LEFT_M, abs=0.01)
    assert level["y"].min() == pytest.approx(-RIGHT_M, abs=0.01)
    assert points["z"].min() == pytest.approx(FLOOR_M, abs=0.02)


def test_turns_are_cut_behind_and_follow_each_other() -> None:
    first, second = cut(list(Vlp16Emulator(us=3_599_950_000).turns(3.6)))[:2]  # over the full hour
    azimuth = np.degrees(np.arctan2(-decode(first)["y"], -decode(first)["x"]))
    assert abs(azimuth[0]) < 0.5
    assert abs(azimuth[-1]) < 0.5
    times = decode(first)["time"]
    assert times[0] == 0
    assert (np.diff(times) >= 0).all()
    assert times[-1] == pytest.approx(0.1, abs=0.001)
    assert second.stamp_ns - first.stamp_ns == pytest.approx(0.1 * SECOND, rel=0.002)


def test_the_stamp_is_of_the_first_firing() -> None:
    emulator = Vlp16Emulator(azimuth_deg=170)
    (turn, *_) = cut(list(emulator.turns(2)))
    begun_us = 10 / 360 * 100_000
    assert turn.stamp_ns == pytest.approx(begun_us * 1000 + 100_000, abs=120_000)


def test_a_late_packet_does_not_move_the_stamps() -> None:
    cutter, found = RevolutionSplitter(), []
    for number, data in enumerate(Vlp16Emulator().turns(3.6)):
        (us,) = struct.unpack_from("<I", data, 1200)
        late = 5_000_000 if number % 3 else 0
        if turn := cutter.add(data, us * 1000 + 1_327_104 + late):
            found.append(turn)
    assert found[0].stamp_ns == pytest.approx(50_000_000, abs=200_000)


def test_dual_returns_are_both_there_once() -> None:
    emulator = Vlp16Emulator(mode=DUAL)
    (turn, *_) = cut(list(emulator.turns(2.6)))
    points = decode(turn)
    assert len(points) == pytest.approx(1.5 * 28_930, rel=0.01)  # every other second return is the first again
    assert np.diff(points["time"]).min() == pytest.approx(-89.9e-6, abs=1e-6)  # back to the pair's begin
    assert points["time"][-1] == pytest.approx(0.1, abs=0.001)


def test_rays_without_a_return_are_left_out() -> None:
    data = bytearray(Vlp16Emulator().packet())
    data[4:7] = bytes(3)
    turn = RawRevolution(packets=bytes(data), us=(0,), first=0, last=12, stamp_ns=0, mode=0x38)
    assert len(decode(turn)) == 383
    assert decode(turn).dtype == POINT_DTYPE


def test_lost_packets_are_counted_by_the_clock_and_leave_their_time_out() -> None:
    packets = list(Vlp16Emulator().turns(2.6))
    cutter = RevolutionSplitter()
    del packets[60:65], packets[80]
    (turn, *_) = cut(packets, cutter)
    assert cutter.counters == {"lost_packets": 6}
    times = decode(turn)["time"]
    assert np.diff(times).max() == pytest.approx(5 * 0.001327, abs=0.0002)
    assert times[-1] == pytest.approx(0.1, abs=0.001)


def test_the_clock_that_jumps_begins_a_new_turn() -> None:
    emulator, cutter = Vlp16Emulator(), RevolutionSplitter()
    cut(list(emulator.turns(0.9)), cutter)
    emulator.us += 5_000_000
    assert cut(list(emulator.turns(0.5)), cutter) == []
    emulator.mode = 0x38
    assert len(cut(list(emulator.turns(2)), cutter)) == 1
    assert cutter.counters == {"clock_jumps": 1, "mode_changes": 1}


@pytest.mark.parametrize(
    ("change", "problem"),
    [
        (lambda data: data[:-1], "wrong_size"),
        (lambda data: data + b"\0", "wrong_size"),
        (lambda data: b"", "wrong_size"),
        (lambda data: b"\0" + data[1:], "wrong_magic"),
        (lambda data: data[:1100] + b"\xee\xff" + data[1102:], "wrong_magic"),
        (lambda data: data[:1204] + b"\x36\x22", "wrong_product"),
        (lambda data: data[:1204] + b"\x37\x28", "wrong_product"),
    ],
)
def test_what_is_no_packet_is_counted(change: object, problem: str) -> None:
    data = Vlp16Emulator().packet()
    assert packet_problem(data) == ""
    cutter = RevolutionSplitter()
    assert cutter.add(change(data), 0) is None  # type: ignore[operator]
    assert cutter.counters == {problem: 1}


def test_an_azimuth_that_stands_still_does_not_fill_the_memory() -> None:
    cutter, emulator = RevolutionSplitter(), Vlp16Emulator()
    for _ in range(2 * MAX_PACKETS + 10):
        emulator.azimuth_deg = 10
        assert cutter.add(emulator.packet(), 0) is None
    assert cutter.counters["overlong_turns"] == 2
    assert len(cutter._packets) <= MAX_PACKETS


@settings(max_examples=40, deadline=None)
@given(st.lists(st.binary(min_size=50, max_size=50), min_size=12, max_size=60), st.integers(0, 2**32 - 1))
def test_any_packets_of_the_right_form_are_decoded_or_not_yet(blocks: list[bytes], us: int) -> None:
    cutter = RevolutionSplitter()
    for at in range(0, len(blocks) - 11, 12):
        body = b"".join(b"\xff\xee" + (block * 2)[:98] for block in blocks[at : at + 12])
        data = body + struct.pack("<IBB", us, (0x37, 0x38, DUAL)[us % 3], 0x22)
        turn = cutter.add(data, at * 1000)
        if turn is not None:
            assert np.isfinite(decode(turn)["x"]).all()


def test_a_position_packet() -> None:
    found = parse_position(position_packet(123_456, 2))
    assert found is not None
    assert (found.us, found.pps, found.gps, found.utc) == (123_456, "locked", "valid", "231126 120304")
    void = parse_position(position_packet(1, 0, "GPRMC,120304,V,,,,,,,231126,,"))
    assert void is not None
    assert (void.pps, void.gps) == ("absent", "void")


@settings(max_examples=40, deadline=None)
@given(st.binary(max_size=600), st.binary(max_size=306))
def test_any_bytes_as_a_position_packet(data: bytes, text: bytes) -> None:
    assert (parse_position(data) is None) == (len(data) != 512)
    found = parse_position((bytes(206) + text).ljust(512, b"\0"))
    assert found is not None
    assert found.gps in ("none", "valid", "void")
