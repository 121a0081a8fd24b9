"""Lines out of whatever bytes come."""

from __future__ import annotations

from collections import Counter
from random import Random  # noqa: TID251 - seeded

from hypothesis import given, settings
from hypothesis import strategies as st

from metaros.drivers.lines import LineSplitter


def splitter(counts: Counter[str], max_bytes: int = 8) -> LineSplitter:
    return LineSplitter(max_bytes=max_bytes, count=lambda name: counts.update([name]))


def test_lines_end_with_cr_lf_or_both_and_may_come_in_pieces() -> None:
    lines = splitter(Counter())
    assert [*lines.feed(b"one\r\ntw"), *lines.feed(b"o\rthree\n\nfo")] == ["one", "two", "three"]
    lines.clear()
    assert list(lines.feed(b"ur\n")) == ["ur"]


def test_a_line_that_is_too_long_is_counted_once_and_the_next_one_is_read() -> None:
    counts: Counter[str] = Counter()
    lines = splitter(counts)
    found = [line for _ in range(100) for line in lines.feed(b"x" * 50)]
    found += [*lines.feed(b"end\nnext\n"), *lines.feed(b"123456789\nok\n")]
    assert found == ["next", "ok"]
    assert counts == {"long_lines": 2}


def test_what_is_no_text_is_counted_and_skipped() -> None:
    counts: Counter[str] = Counter()
    assert list(splitter(counts).feed(b"\xff\xfe\na\0b\nok\n")) == ["ok"]
    assert counts == {"bad_lines": 2}


def test_a_megabyte_of_noise_is_passed_over() -> None:
    counts: Counter[str] = Counter()
    lines, noise = splitter(counts, max_bytes=64), Random(8).randbytes(1_000_000)
    for at in range(0, len(noise), 4096):
        assert all(len(line) <= 64 for line in lines.feed(noise[at : at + 4096]))
        assert len(lines._rest) <= 64
    assert counts["long_lines"] > 1000
    assert list(lines.feed(b"\nok\n"))[-1] == "ok"


@settings(deadline=None)
@given(st.lists(st.binary(max_size=40)))
def test_any_pieces_give_what_the_whole_gives_and_little_is_kept(pieces: list[bytes]) -> None:
    whole, parts = splitter(Counter()), splitter(Counter())
    found = [line for piece in pieces for line in parts.feed(piece)]
    assert found == list(whole.feed(b"".join(pieces)))
    assert all(0 < len(line) <= 8 for line in found)
    assert len(parts._rest) <= 8
