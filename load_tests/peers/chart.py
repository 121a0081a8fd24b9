"""The message rates as a picture: one panel a size, one bar a row, on a logarithmic scale. Plain SVG, no library."""

from __future__ import annotations

import math
from collections.abc import Sequence
from html import escape

from load_tests.peers.results import Results
from load_tests.peers.rows import Row, size_name

__all__ = ["as_svg", "bar_width"]

_WIDTH, _LABEL, _VALUE = 760, 220, 90
_BAR, _GAP, _HEAD, _MARGIN = 16, 6, 34, 16
_OURS, _RAW, _OTHERS = "#2f855a", "#4a5568", "#a0aec0"
_FONT = "font-family='system-ui, sans-serif'"


def bar_width(rate: float, low: float, high: float, full: float) -> float:
    """How long a bar is between the decade below the least rate and the decade above the greatest."""
    bottom, top = math.floor(math.log10(low)), math.ceil(math.log10(high))
    return full * (math.log10(rate) - bottom) / max(1, top - bottom)


def _colour(row: Row) -> str:
    return {"metaros": _OURS, "zenoh": _RAW}.get(row.peer, _OTHERS)


def _panel(title: str, rates: Sequence[tuple[Row, float]], top: float) -> list[str]:
    """Heading and bars from `top` down."""
    low, high = min(rate for _, rate in rates), max(rate for _, rate in rates)
    low = low if low < high else low / 2
    full = _WIDTH - _LABEL - _VALUE - 2 * _MARGIN
    parts = [f"<text x='{_MARGIN}' y='{top + 20:.0f}' font-weight='600' font-size='15'>{escape(title)}</text>"]
    for number, (row, rate) in enumerate(rates):
        y = top + _HEAD + number * (_BAR + _GAP)
        width = max(1.0, bar_width(rate, low, high, full))
        left, text_y = _MARGIN + _LABEL, y + _BAR - 4
        value = f"{rate:,.0f}" if rate >= 100 else f"{rate:.1f}"
        parts += [
            f"<text x='{left - 8}' y='{text_y}' text-anchor='end' font-size='12'>{escape(row.label)}</text>",
            f"<rect x='{left}' y='{y}' width='{width:.1f}' height='{_BAR}' rx='2' fill='{_colour(row)}'/>",
            f"<text x='{left + width + 6:.1f}' y='{text_y}' font-size='12'>{value}</text>",
        ]
    return parts


def as_svg(results: Results) -> str:
    """The whole picture; sizes without figures are left out."""
    top, parts = float(_MARGIN), []
    for size in results.sizes:
        rates = [(row, rate) for row, cell in results.rows_at(size) if (rate := cell.median("rate"))]
        if not rates:
            continue
        parts += _panel(f"{size_name(size)}: messages a second (logarithmic)", rates, top)
        top += _HEAD + len(rates) * (_BAR + _GAP) + _MARGIN
    height = top + _MARGIN
    head = f"<svg xmlns='http://www.w3.org/2000/svg' viewBox='0 0 {_WIDTH} {height:.0f}' {_FONT} fill='#1a202c'>"
    paper = f"<rect width='{_WIDTH}' height='{height:.0f}' fill='#ffffff'/>"
    return "\n".join([head, paper, *parts, "</svg>", ""])
