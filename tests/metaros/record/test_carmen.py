"""CARMEN parsing: real logs counted, malformed lines named, time put in order."""

from __future__ import annotations

import bz2
import gzip
import io
from itertools import islice
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from metaros.errors import ConfigError
from metaros.record.carmen import LINE_BYTES, LaserLine, LogCount, OdometryLine, in_ipc_order, open_log, read_log
from tests.support.data import data_set

LASER = "FLASER 3 1.5 2.25 81.83 1.1 2.2 0.3 1.0 2.0 0.3 12.25 host 0.5"
ODOM = "ODOM 1.0 2.0 0.3 0.5 0.1 0.0 12.5 host 0.75"


def parse(text: str) -> tuple[list[LaserLine | OdometryLine], LogCount]:
    count = LogCount()
    return list(read_log(io.BytesIO(text.encode()), count)), count


def test_the_two_messages() -> None:
    (laser, odometry), count = parse(f"# a comment\n\n{LASER}\n{ODOM}\n")
    assert isinstance(laser, LaserLine)
    np.testing.assert_array_equal(laser.ranges_m, np.array([1.5, 2.25, 81.83], np.float32))
    assert (laser.stamp_s, laser.laser_pose, laser.robot_pose) == (12.25, (1.1, 2.2, 0.3), (1.0, 2.0, 0.3))
    assert odometry == OdometryLine(12.5, (1.0, 2.0, 0.3), 0.5, 0.1)
    assert (count.scans, count.odometry, count.malformed, count.skipped) == (1, 1, 0, 0)


def test_params_and_other_messages() -> None:
    records, count = parse(
        "PARAM robot_frontlaser_offset -0.04 1.0 host 1.0\nPARAM a b nohost 0\nRLASER 1 2 3\nNMEA-GGA 1\n"
    )
    assert records == []
    assert count.params == {"robot_frontlaser_offset": "-0.04", "a": "b"}
    assert (count.skipped, count.malformed) == (2, 0)


@pytest.mark.parametrize(
    ("line", "reason"),
    [
        ("FLASER 4 1.5 2.25 81.83 1.1 2.2 0.3 1.0 2.0 0.3 12.25 host 0.5", "4 readings"),
        ("FLASER -1 1.5", "-1 readings"),
        ("FLASER", "index"),
        ("FLASER x 1 2", "invalid literal"),
        ("ODOM 1.0 2.0 0.3", "4 words, not 10"),
        ("ODOM 1.0 2.0 nan 0.5 0.1 0.0 12.5 host 0.75", "not a finite number"),
        ("ODOM 1.0 2.0 abc 0.5 0.1 0.0 12.5 host 0.75", "could not convert"),
        ("PARAM lonely", "name and a value"),
        ("\x00\x01\x02", "no message name"),
        ("F" * (LINE_BYTES + 5), "longer than"),
    ],
)
def test_malformed_lines_are_counted_and_named(line: str, reason: str) -> None:
    records, count = parse(f"{ODOM}\n{line}\n{LASER}\n")
    assert len(records) == 2
    assert count.malformed == 1
    (complaint,) = count.complaints
    assert complaint.startswith("line 2: ")
    assert reason in complaint


def test_only_the_first_complaints_are_kept() -> None:
    _, count = parse("ODOM\n" * 1000)
    assert count.malformed == 1000
    assert len(count.complaints) == 5


@settings(max_examples=50)
@given(st.binary(max_size=300))
def test_any_bytes_are_read_or_counted(junk: bytes) -> None:
    count = LogCount()
    records = list(read_log(io.BytesIO(junk + b"\n" + ODOM.encode()), count))
    assert records[-1] == OdometryLine(12.5, (1.0, 2.0, 0.3), 0.5, 0.1)


def odometry(*stamps: float) -> list[OdometryLine]:
    return [OdometryLine(stamp, (float(index), 0.0, 0.0), 0.0, 0.0) for index, stamp in enumerate(stamps)]


def test_ipc_order_sorts_small_steps_back_and_keeps_ties() -> None:
    count = LogCount()
    ordered = list(in_ipc_order(odometry(1.0, 3.0, 2.0, 2.0, 9.0, 8.5), count, window_s=2.0))
    assert [record.stamp_s for record in ordered] == [1.0, 2.0, 2.0, 3.0, 8.5, 9.0]
    assert [record.pose[0] for record in ordered[1:3]] == [2.0, 3.0]  # type: ignore[union-attr]
    assert count.late == 0


def test_a_step_back_beyond_the_window_is_given_at_once_and_counted() -> None:
    count = LogCount()
    ordered = list(in_ipc_order(odometry(1.0, 10.0, 20.0, 2.0, 21.0), count, window_s=2.0))
    assert sorted(record.stamp_s for record in ordered) == [1.0, 2.0, 10.0, 20.0, 21.0]
    assert count.late == 1


@pytest.mark.parametrize(
    ("name", "scans", "odometry_lines", "lines"),
    [("intel", 671, 1318, 2000), ("aces", 7_374, 7_375, None), ("fr079", 641, 1161, 2000)],
)
def test_real_logs(name: str, scans: int, odometry_lines: int, lines: int | None) -> None:
    """One as a whole, of others the first lines."""
    count = LogCount()
    with open_log(data_set(f"robots/{name}.clf.bz2")) as source:
        part = source if lines is None else io.BytesIO(b"".join(islice(source, lines)))
        records = list(in_ipc_order(read_log(part, count), count))
    assert (count.scans, count.odometry) == (scans, odometry_lines)
    assert (count.malformed, count.skipped, count.late) == (0, 0, 0)
    stamps = [record.stamp_s for record in records]
    assert len(stamps) == scans + odometry_lines
    assert stamps == sorted(stamps)
    assert "robot_frontlaser_offset" in count.params


def test_compressed_logs_are_opened_by_their_name(tmp_path: Path) -> None:
    text = f"{ODOM}\n".encode()
    for name, data in (("a.clf", text), ("a.clf.bz2", bz2.compress(text)), ("a.clf.gz", gzip.compress(text))):
        (tmp_path / name).write_bytes(data)
        with open_log(tmp_path / name) as source:
            assert len(list(read_log(source, LogCount()))) == 1


def test_a_missing_file_is_named(tmp_path: Path) -> None:
    with pytest.raises(ConfigError, match=r"nowhere\.clf"):
        open_log(tmp_path / "nowhere.clf")
