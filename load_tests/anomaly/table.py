"""Columns of text, aligned: words left, figures right."""

from __future__ import annotations

from collections.abc import Iterable, Sequence

__all__ = ["table"]


def table(names: Sequence[str], rows: Iterable[Sequence[str]]) -> str:
    """A header and rows; the first column is of words."""
    lines = [tuple(names), *(tuple(row) for row in rows)]
    widths = [max(len(line[at]) for line in lines) for at in range(len(names))]
    rule = tuple("─" * width for width in widths)
    lines.insert(1, rule)
    return "\n".join("  " + "  ".join(_cell(at, line[at], widths[at]) for at in range(len(names))) for line in lines)


def _cell(at: int, text: str, width: int) -> str:
    return text.rjust(width) if at else text.ljust(width)
