"""The log: what was appended comes back, up to what is torn or damaged."""

from __future__ import annotations

import os
from pathlib import Path

import pytest

from gateway.alerting.watch.log import MAX_RECORD_BYTES, LogFile, read_log

RECORDS = [(1, b"one"), (2, b""), (1, b"x" * 5000)]


def filled(path: Path) -> Path:
    log = LogFile(path)
    for kind, payload in RECORDS:
        log.append(kind, payload)
    assert log.size_bytes == path.stat().st_size
    log.close()
    return path


def test_records_come_back_in_their_order(tmp_path: Path) -> None:
    assert list(read_log(filled(tmp_path / "log"))) == RECORDS


def test_every_torn_end_leaves_what_was_whole(tmp_path: Path) -> None:
    data = filled(tmp_path / "log").read_bytes()
    torn = tmp_path / "torn"
    for size in [*range(60), len(data) - 1]:
        torn.write_bytes(data[:size])
        found = list(read_log(torn))
        assert found == RECORDS[: len(found)]
    assert found == RECORDS[:2]


@pytest.mark.parametrize("at", [0, 6, 10, 14, 15, 40])
def test_a_flipped_byte_ends_the_log_there(tmp_path: Path, at: int) -> None:
    path = filled(tmp_path / "log")
    data = bytearray(path.read_bytes())
    data[at] ^= 0x55
    path.write_bytes(data)
    found = list(read_log(path))
    assert len(found) < len(RECORDS)
    assert found == RECORDS[: len(found)]


def test_a_log_that_is_there_is_not_written_again(tmp_path: Path) -> None:
    path = filled(tmp_path / "log")
    with pytest.raises(FileExistsError):
        LogFile(path)


@pytest.mark.skipif(os.name != "posix", reason="files are limited by POSIX's means")
def test_where_the_disk_takes_none_no_file_is_left_open_or_behind(tmp_path: Path) -> None:
    import resource

    before = resource.getrlimit(resource.RLIMIT_FSIZE)
    opened = len(os.listdir("/dev/fd"))
    resource.setrlimit(resource.RLIMIT_FSIZE, (3, before[1]))
    try:
        for _ in range(3):
            with pytest.raises(OSError, match=r"only 3 of 6|File too large"):
                LogFile(tmp_path / "log")
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, before)
    assert len(os.listdir("/dev/fd")) == opened
    assert list(tmp_path.iterdir()) == []


def test_a_record_that_would_not_be_read_again_is_not_written(tmp_path: Path) -> None:
    log = LogFile(tmp_path / "log")
    with pytest.raises(OSError, match="at most"):
        log.append(1, bytes(MAX_RECORD_BYTES + 1))
    log.append(1, b"small")
    log.close()
    assert list(read_log(tmp_path / "log")) == [(1, b"small")]
