"""Samples as lines of numbers."""

from __future__ import annotations

import math
from collections import Counter

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from metaros.drivers.imu.csv_lines import CsvDecoder
from metaros.drivers.imu.sample import GRAVITY_M_S2, Sample, plausible


def samples_of(data: bytes, counts: Counter[str] | None = None, **units: str) -> list[Sample]:
    counts = Counter() if counts is None else counts
    wanted = {"acceleration": "m/s2", "rate": "rad/s", "magnetic": "uT"} | units
    return list(CsvDecoder(lambda name: counts.update([name]), **wanted).feed(data))


@pytest.mark.parametrize("line", ["1,2,3,4,5,6", "1;2;3; 4;5;6", "1 2\t3  4 5 6", " 1.0, 2e0, +3, 4., 5, 06 "])
def test_six_numbers_are_a_sample(line: str) -> None:
    assert samples_of(f"{line}\r\n".encode()) == [Sample(acceleration_m_s2=(1, 2, 3), rate_rad_s=(4, 5, 6))]


def test_nine_numbers_have_the_magnetic_field_and_units_are_converted() -> None:
    units = {"acceleration": "g", "rate": "deg/s", "magnetic": "mG"}
    (sample,) = samples_of(b"0,0,1,180,0,-90,200,0,-400\n", **units)
    assert sample.acceleration_m_s2 == (0, 0, GRAVITY_M_S2)
    assert sample.rate_rad_s == pytest.approx((math.pi, 0, -math.pi / 2))
    assert sample.magnetic_t == pytest.approx((20e-6, 0, -40e-6))


def test_other_lines_are_counted_and_skipped() -> None:
    counts: Counter[str] = Counter()
    data = (
        b"ax,ay,az,gx,gy,gz\n1,2,3\n1,2,3,4,5,6,7\n1,2,3,4,5,x\n1,2,3,4,5,6_0\n"
        + b"9" * 1000
        + b"\n\xff\xff\n1,2,3,4,5,6\n"
    )
    assert len(samples_of(data, counts)) == 1
    assert counts == {"bad_lines": 6, "long_lines": 1}


@pytest.mark.parametrize("word", ["nan", "inf", "-inf", "1e300", "9999"])
def test_what_no_sensor_measures_is_implausible(word: str) -> None:
    assert [plausible(sample) for sample in samples_of(f"0,0,{word},0,0,0\n0,0,0,0,{word},0\n".encode())] == [False] * 2


@settings(deadline=None)
@given(st.binary(max_size=600))
def test_nothing_stops_the_decoder(data: bytes) -> None:
    found = samples_of(data + b"\n1,2,3,4,5,6\n")
    assert found[-1].rate_rad_s == (4, 5, 6)
