"""The bounded log file."""

from __future__ import annotations

from pathlib import Path

from metaros.supervise.logs.file import RotatingLog


def test_the_file_never_exceeds_its_size_and_keeps_one_predecessor(tmp_path: Path) -> None:
    log = RotatingLog(tmp_path / "deep" / "a.log", size_bytes=100)
    for number in range(50):
        log.write(f"line {number}\n".encode())
    log.close()
    assert log.path.stat().st_size <= 100
    older = log.path.with_name("a.log.1")
    assert older.stat().st_size <= 100
    assert (older.read_text() + log.path.read_text()).endswith("line 48\nline 49\n")
    assert sorted(path.name for path in log.path.parent.iterdir()) == ["a.log", "a.log.1"]


def test_one_huge_write_is_cut_to_its_end(tmp_path: Path) -> None:
    log = RotatingLog(tmp_path / "a.log", size_bytes=10)
    log.write(b"x" * 1000 + b"end")
    log.close()
    assert log.path.read_bytes() == b"x" * 7 + b"end"


def test_a_second_life_appends(tmp_path: Path) -> None:
    for word in (b"one\n", b"two\n"):
        log = RotatingLog(tmp_path / "a.log")
        log.write(word)
        log.close()
    assert log.path.read_bytes() == b"one\ntwo\n"
    assert log.tail() == ["two"]


def test_the_tail_joins_pieces_and_skips_blank_lines(tmp_path: Path) -> None:
    log = RotatingLog(tmp_path / "a.log")
    for piece in (b"hel", b"lo\n\n  \nwor", b"ld", b"\xff\n", b"unfinished"):
        log.write(piece)
    log.close()
    assert log.tail() == ["hello", "world\ufffd", "unfinished"]
