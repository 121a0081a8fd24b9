"""Plots as inline SVG: lines over time, and costs over sizes on logarithmic axes; the page's style colours them."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from html import escape
from typing import Final

__all__ = ["Line", "growth_plot", "time_plot"]

WIDTH: Final = 720
HEIGHT: Final = 250
LEFT, RIGHT, TOP, BOTTOM = 58, 14, 30, 34
MOST_POINTS: Final = 400


@dataclass(frozen=True, slots=True)
class Line:
    """A named line; `kind` picks its colour, 1 to 4."""

    name: str
    xs: Sequence[float]
    ys: Sequence[float]
    kind: int = 1


@dataclass(frozen=True, slots=True)
class _Scale:
    low: float
    high: float
    start: float
    end: float
    log: bool = False

    def at(self, value: float) -> float:
        """Where a value is in the picture."""
        if self.log:
            value, low, high = math.log10(max(value, 1e-12)), math.log10(self.low), math.log10(self.high)
        else:
            low, high = self.low, self.high
        share = (value - low) / (high - low) if high > low else 0.0
        return self.start + min(max(share, -0.02), 1.02) * (self.end - self.start)


def time_plot(title: str, unit: str, lines: Sequence[Line], *, marks: Sequence[tuple[float, str]] = ()) -> str:
    """Lines over seconds from 0, with named moments."""
    most_x = max((max(line.xs, default=0.0) for line in lines), default=1.0) or 1.0
    most_y = nice_top(max((max(line.ys, default=0.0) for line in lines), default=1.0))
    x = _Scale(0.0, most_x, LEFT, WIDTH - RIGHT)
    y = _Scale(0.0, most_y, HEIGHT - BOTTOM, TOP)
    body = [*_grid_y(y, linear_ticks(most_y)), *_ticks_x(x, linear_ticks(most_x), " s")]
    row = 0
    for at, text in marks:
        if at <= most_x:
            place = x.at(at)
            body.append(f'<line class="mark" x1="{place:.1f}" x2="{place:.1f}" y1="{TOP}" y2="{HEIGHT - BOTTOM}"/>')
            side = "end" if place > WIDTH * 0.8 else "start"
            shift = -4 if side == "end" else 4
            body.append(
                f'<text class="said" x="{place + shift:.1f}" y="{TOP + 10 + 12 * (row % 3)}" text-anchor="{side}">'
                f"{escape(text)}</text>"
            )
            row += 1
    body += [_path(line, x, y) for line in lines]
    return _figure(title, unit, lines, body)


def growth_plot(title: str, unit: str, lines: Sequence[Line], *, bend: tuple[float, str] | None = None) -> str:
    """Figures over numbers of robots, both axes logarithmic, each measured point a dot."""
    xs = [value for line in lines for value in line.xs if value > 0]
    ys = [value for line in lines for value in line.ys if value > 0]
    if not xs or not ys:
        return ""
    x = _Scale(min(xs) / 1.3, max(xs) * 1.3, LEFT, WIDTH - RIGHT, log=True)
    y = _Scale(
        10 ** math.floor(math.log10(min(ys))), 10 ** math.ceil(math.log10(max(ys) * 1.05)), HEIGHT - BOTTOM, TOP, True
    )
    decades = [10.0**power for power in range(round(math.log10(y.low)), round(math.log10(y.high)) + 1)]
    body = [*_grid_y(y, decades), *_ticks_x(x, sorted(set(xs)), "")]
    if bend is not None:
        place = x.at(bend[0])
        side = "end" if place > WIDTH * 0.55 else "start"
        body.append(f'<line class="bend" x1="{place:.1f}" x2="{place:.1f}" y1="{TOP}" y2="{HEIGHT - BOTTOM}"/>')
        body.append(
            f'<text class="said" x="{place + (-5 if side == "end" else 5):.1f}" y="{TOP + 12}" text-anchor="{side}">'
            f"{escape(bend[1])}</text>"
        )
    for line in lines:
        body.append(_path(line, x, y))
        dots = zip(line.xs, line.ys, strict=True)
        body += [
            f'<circle class="dot k{line.kind}" cx="{x.at(a):.1f}" cy="{y.at(b):.1f}" r="3.5"/>'
            for a, b in dots
            if b > 0
        ]
    return _figure(title, unit, lines, body)


def nice_top(value: float) -> float:
    """A round number above it."""
    if value <= 0:
        return 1.0
    power = 10.0 ** math.floor(math.log10(value))
    return next(step * power for step in (1, 1.5, 2, 3, 4, 5, 6, 8, 10, 15) if step * power >= value * 1.02)


def linear_ticks(most: float) -> list[float]:
    """About five round numbers from 0."""
    power = 10.0 ** math.floor(math.log10(most / 4)) if most > 0 else 1.0
    step = next(factor * power for factor in (1, 2, 2.5, 5, 10) if most / (factor * power) <= 6)
    return [step * number for number in range(int(most / step + 1e-9) + 1)]


def short(value: float) -> str:
    """A number as an axis shows it."""
    for size, letter in ((1e9, "G"), (1e6, "M"), (1e3, "k")):
        if abs(value) >= size:
            return f"{value / size:g}{letter}"
    return f"{value:g}"


def _grid_y(y: _Scale, ticks: Sequence[float]) -> list[str]:
    found = []
    for tick in ticks:
        place = y.at(tick)
        found.append(f'<line class="grid" x1="{LEFT}" x2="{WIDTH - RIGHT}" y1="{place:.1f}" y2="{place:.1f}"/>')
        found.append(
            f'<text class="tick" x="{LEFT - 6}" y="{place + 4:.1f}" text-anchor="end">{short(round(tick, 9))}</text>'
        )
    return found


def _ticks_x(x: _Scale, ticks: Sequence[float], unit: str) -> list[str]:
    place = f'y="{HEIGHT - BOTTOM + 16}" text-anchor="middle"'
    return [f'<text class="tick" x="{x.at(tick):.1f}" {place}>{short(tick)}{unit}</text>' for tick in ticks]


def _path(line: Line, x: _Scale, y: _Scale) -> str:
    points = list(zip(line.xs, line.ys, strict=True))
    if len(points) > MOST_POINTS:  # the highest of each stretch, so that no peak is hidden
        step = math.ceil(len(points) / MOST_POINTS)
        points = [max(points[at : at + step], key=lambda point: point[1]) for at in range(0, len(points), step)]
    if y.log:
        points = [point for point in points if point[1] > 0]
    places = " ".join(f"{x.at(a):.1f},{y.at(b):.1f}" for a, b in points)
    return f'<polyline class="line k{line.kind}" points="{places}"/>'


def _figure(title: str, unit: str, lines: Sequence[Line], body: Sequence[str]) -> str:
    legend = "".join(f'<span class="key"><i class="k{line.kind}"></i>{escape(line.name)}</span>' for line in lines)
    caption = f"<figcaption><b>{escape(title)}</b> <small>{escape(unit)}</small>{legend}</figcaption>"
    label = escape(f"{title}, {unit}", quote=True)
    svg = f'<svg viewBox="0 0 {WIDTH} {HEIGHT}" role="img" aria-label="{label}">{"".join(body)}</svg>'
    return f"<figure>{caption}{svg}</figure>"
