"""WITMotion's frames."""

from __future__ import annotations

import math
from collections import Counter
from random import Random  # noqa: TID251 - seeded

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from metaros.drivers.imu.sample import GRAVITY_M_S2, Sample, plausible
from metaros.drivers.imu.witmotion import FRAME_BYTES, WitMotionDecoder, from_euler
from tests.support.devices.imu_emulator import wit_frame, wit_round


def samples_of(data: bytes, counts: Counter[str] | None = None, *, chunk: int = 4096) -> list[Sample]:
    counts = Counter() if counts is None else counts
    decoder = WitMotionDecoder(lambda name, by: counts.update({name: by}))
    return [sample for at in range(0, len(data), chunk) for sample in decoder.feed(data[at : at + chunk])]


@pytest.mark.parametrize("chunk", [1, 5, 4096])
def test_a_round_of_frames_is_a_sample(chunk: int) -> None:
    stream = wit_round(acceleration_g=(0.5, -1, 2), rate_deg_s=(90, 0, -180), angles_deg=(0, 0, 90))
    first, second = samples_of(stream * 2, chunk=chunk)
    assert first == second
    assert first.acceleration_m_s2 == pytest.approx((GRAVITY_M_S2 / 2, -GRAVITY_M_S2, 2 * GRAVITY_M_S2))
    assert first.rate_rad_s == pytest.approx((math.pi / 2, 0, -math.pi), abs=1e-3)
    assert first.magnetic_t == pytest.approx((20e-6, 0, -40e-6))
    assert first.temperature_c == 25.5
    assert first.orientation == pytest.approx((math.sqrt(0.5), 0, 0, math.sqrt(0.5)), abs=1e-4)


def test_the_example_frame_of_the_data_sheet() -> None:
    frame = bytes((0x55, 0x51, 0x00, 0x08, 0x00, 0xF8, 0x00, 0x08, 0xC4, 0x09))  # 1 g, -1 g, 1 g, 25 degrees
    frame += bytes((sum(frame) & 0xFF,))
    (sample,) = samples_of((frame + wit_frame(0x52, (0, 0, 0, 0))) * 2)[:1]
    assert sample.acceleration_m_s2 == pytest.approx((GRAVITY_M_S2, -GRAVITY_M_S2, GRAVITY_M_S2))
    assert (sample.temperature_c, sample.orientation, sample.magnetic_t) == (25.0, None, None)


def test_a_quaternion_is_taken_before_angles() -> None:
    stream = wit_round(angles_deg=(10, 20, 30)) + wit_frame(0x59, (0, 32767, 0, 0))
    assert samples_of(stream * 2)[0].orientation == (0, 1, 0, 0)
    nothing = wit_round() + wit_frame(0x59, (0, 0, 0, 0))
    assert samples_of(nothing * 2)[0].orientation is None


def test_a_round_that_lost_its_acceleration_is_no_sample() -> None:
    lost = wit_round()[FRAME_BYTES:]
    assert len(samples_of(wit_round() * 3 + lost + wit_round() * 3)) == 6


def test_bad_checksums_are_counted_and_the_next_frame_is_found() -> None:
    counts: Counter[str] = Counter()
    bad = bytearray(wit_round())
    bad[4] ^= 0x40
    found = samples_of(wit_round() * 2 + bytes(bad) + wit_round() * 2, counts)
    assert len(found) == 4
    assert counts["bad_checksum"] >= 1
    assert counts["skipped_bytes"] >= 1


def test_frames_of_other_kinds_are_left() -> None:
    other = b"".join(wit_frame(kind, (1, 2, 3, 4)) for kind in (0x50, 0x55, 0x56, 0x57, 0x58, 0x5A))
    counts: Counter[str] = Counter()
    assert len(samples_of((wit_round() + other) * 3, counts)) == 3
    assert counts == {}


def test_a_megabyte_of_noise_gives_nothing_implausible_and_little_is_kept() -> None:
    counts: Counter[str] = Counter()
    decoder = WitMotionDecoder(lambda name, by: counts.update({name: by}))
    noise = Random(5).randbytes(1_000_000)
    for at in range(0, len(noise), 4096):
        assert all(plausible(sample) for sample in decoder.feed(noise[at : at + 4096]))
        assert len(decoder._data) < FRAME_BYTES
    assert counts["skipped_bytes"] > 900_000
    assert len([*decoder.feed(bytes(FRAME_BYTES)), *decoder.feed(wit_round() * 5)]) >= 4


@settings(deadline=None, max_examples=50)
@given(st.lists(st.one_of(st.binary(max_size=30), st.just(b"U"), st.just(wit_round()))))
def test_anything_in_pieces_gives_what_the_whole_gives(pieces: list[bytes]) -> None:
    whole = b"".join(pieces)
    assert samples_of(whole, chunk=7) == samples_of(whole)
    assert all(plausible(sample) for sample in samples_of(whole))


@settings(deadline=None, max_examples=30)
@given(*[st.floats(-math.pi, math.pi)] * 3)
def test_euler_angles_give_a_unit_quaternion(roll: float, pitch: float, yaw: float) -> None:
    assert math.hypot(*from_euler(roll, pitch, yaw)) == pytest.approx(1)
