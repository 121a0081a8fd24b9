"""Pages of a log: forwards, backwards, with a word, over the turn of the file."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from pathlib import Path

import pytest

from metaros.clock import ManualClock
from metaros.errors import ConfigError
from metaros.supervise.logs.file import RotatingLog
from metaros.supervise.logs.reader import Page, read_page


@pytest.fixture
def clock() -> ManualClock:
    return ManualClock()


@pytest.fixture
def write(tmp_path: Path, clock: ManualClock) -> Iterator[Callable[..., None]]:
    log = RotatingLog(tmp_path / "n.log", size_bytes=4096, stamp=clock.wall_ns)

    def put(*lines: str) -> None:
        for line in lines:
            clock.advance(1.0)
            log.write(line.encode() + b"\n")

    yield put
    log.close()


def put_once(path: Path, clock: ManualClock, data: bytes) -> None:
    log = RotatingLog(path, stamp=clock.wall_ns)
    log.write(data)
    log.close()


def texts(page: Page) -> list[str]:
    return [text for _, text in page.lines]


def forwards(path: Path, cursor: str = "0", **options: object) -> list[str]:
    found: list[str] = []
    while True:
        page = read_page(path, cursor=cursor, max_bytes=500, **options)  # type: ignore[arg-type]
        found += texts(page)
        if not page.more:
            return found
        assert page.cursor != cursor
        cursor = page.cursor


def backwards(path: Path, **options: object) -> list[str]:
    page = read_page(path, backwards=True, max_bytes=500, **options)  # type: ignore[arg-type]
    found = texts(page)
    while page.more:
        page = read_page(path, backwards=True, cursor=page.cursor, max_bytes=500, **options)  # type: ignore[arg-type]
        found = texts(page) + found
    return found


def test_a_line_has_its_time(tmp_path: Path, write: Callable[..., None], clock: ManualClock) -> None:
    write("hello")
    assert read_page(tmp_path / "n.log").lines == ((clock.wall_ns(), "hello"),)


def test_pages_both_ways_give_every_line_once_over_a_turned_file(tmp_path: Path, write: Callable[..., None]) -> None:
    lines = [f"line {number}" for number in range(120)]
    write(*lines)
    assert (tmp_path / "n.log.1").exists()
    kept = backwards(tmp_path / "n.log")
    assert kept == lines[-len(kept) :]
    assert len(kept) > 90
    assert forwards(tmp_path / "n.log") == kept


def test_a_cursor_outlives_the_turn_of_the_file(tmp_path: Path, write: Callable[..., None]) -> None:
    write(*(f"old {number}" for number in range(30)))
    cursor = read_page(tmp_path / "n.log").cursor
    write(*(f"new {number}" for number in range(150)))
    assert (tmp_path / "n.log.1").exists()
    assert forwards(tmp_path / "n.log", cursor) == [f"new {number}" for number in range(150)]


def test_what_was_thrown_away_is_skipped(tmp_path: Path, write: Callable[..., None]) -> None:
    write("first")
    cursor = read_page(tmp_path / "n.log").cursor
    write(*(f"line {number}" for number in range(1000)))
    found = forwards(tmp_path / "n.log", cursor)
    assert found[-1] == "line 999"
    assert 50 < len(found) < 300


def test_only_lines_with_the_word(tmp_path: Path, write: Callable[..., None]) -> None:
    write("motor on", "Battery low", "motor off", "battery dead")
    assert forwards(tmp_path / "n.log", query="BATTERY") == ["Battery low", "battery dead"]
    assert backwards(tmp_path / "n.log", query="motor") == ["motor on", "motor off"]
    assert forwards(tmp_path / "n.log", query="2026-") == []  # the time is no text of the node's


def test_new_lines_come_after_the_cursor(tmp_path: Path, write: Callable[..., None]) -> None:
    write("one")
    page = read_page(tmp_path / "n.log")
    assert texts(read_page(tmp_path / "n.log", cursor=page.cursor)) == []
    write("two")
    assert texts(read_page(tmp_path / "n.log", cursor=page.cursor)) == ["two"]


def test_a_log_that_goes_on_after_a_power_cut(tmp_path: Path, clock: ManualClock) -> None:
    path = tmp_path / "n.log"
    put_once(path, clock, b"whole\n")
    with path.open("ab") as file:
        file.write(b"2026-01-01T00:00:00.0000")
    put_once(path, clock, b"after\n")
    assert forwards(path)[0] == "whole"
    assert forwards(path)[-1] == "after"


def test_a_log_without_stamps_is_turned_over(tmp_path: Path, clock: ManualClock) -> None:
    path = tmp_path / "n.log"
    path.write_bytes(b"of another program\n" * 10)
    put_once(path, clock, b"ours\n")
    assert forwards(path) == ["ours"]
    assert (tmp_path / "n.log.1").read_bytes().startswith(b"of another")


def test_long_lines_carriage_returns_and_no_text_at_all(tmp_path: Path, clock: ManualClock) -> None:
    path = tmp_path / "n.log"
    log = RotatingLog(path, stamp=clock.wall_ns)
    log.write(b"x" * 40_000 + b"\n10%\r50%\r100%\n" + bytes(range(256)).replace(b"\n", b"") + b"\nend")
    log.close()
    found = forwards(path)
    assert "".join(found[:3]) == "x" * 40_000
    assert found[3] == "10%\r50%\r100%"
    assert found[-1] == "end"


def test_no_log_yet(tmp_path: Path) -> None:
    assert read_page(tmp_path / "n.log").as_json() == {"lines": [], "cursor": "0", "more": False}


@pytest.mark.parametrize("cursor", ["x", "-1", "1e9", "9" * 21, "٣"])
def test_a_cursor_of_nobody(tmp_path: Path, cursor: str) -> None:
    with pytest.raises(ConfigError, match="cursor"):
        read_page(tmp_path / "n.log", cursor=cursor)


def test_a_query_is_bounded(tmp_path: Path) -> None:
    with pytest.raises(ConfigError, match="256"):
        read_page(tmp_path / "n.log", query="x" * 257)
