"""A backtest's report as a picture: each series with what was expected of it, and where it would have fired. Pure.

It is drawn from the document that REST gives. It follows the reader's light or dark setting, needs no script and no
font, and its titles (what a browser shows under the pointer) tell why.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from datetime import datetime
from html import escape
from itertools import groupby, pairwise
from typing import Any

from gateway.alerting.backtest.axis import Axis, number, time_ticks, value_ticks
from gateway.alerting.backtest.plot_style import STYLE

__all__ = ["MOST_PANELS", "plot_svg"]

MOST_PANELS, MOST_LANES, MOST_MARKS = 24, 12, 40
WIDTH, MARGIN, LEFT = 1120.0, 24.0, 74.0
HEAD, LANE, PANEL, TITLE, GAP, FOOT = 62.0, 22.0, 120.0, 26.0, 14.0, 26.0
HOLE = 4.0  # points farther apart than so many of the usual steps are not joined
_UNPRINTABLE = re.compile(r"[^\t\n\x20-\ud7ff\ue000-\ufffd\U00010000-\U0010ffff]")
Point = Sequence[Any]  # stamp_ms, value, low, high, score


@dataclass(frozen=True, slots=True)
class Frame:
    """Where something is drawn: its top, and the axis of time that all share."""

    top: float
    height: float
    time: Axis

    @property
    def bottom(self) -> float:
        """Its lower edge."""
        return self.top + self.height


def plot_svg(report: Mapping[str, Any]) -> str:
    """The whole document: the alerts as bars, and a panel for each series, those first of which something fired."""
    begin_ms, end_ms = (_ms(report["span"][name]) for name in ("from", "to"))
    axis = Axis(begin_ms, end_ms, MARGIN + LEFT, WIDTH - MARGIN - 10)
    lanes = report["alerts"][:MOST_LANES]
    panels = report["series"][:MOST_PANELS]
    top = HEAD + MARGIN
    body = [*_header(report), *_lanes(lanes, top, axis)]
    top += LANE * len(lanes) + (GAP if lanes else 0)
    for series in panels:
        frame = Frame(top + TITLE, PANEL, axis)
        fired = [item for item in report["findings"] if item["series"] == series["series"]]
        body += _panel(series, fired[:MOST_MARKS], frame)
        top = frame.bottom + GAP
    body += _times(axis, HEAD + MARGIN, top)
    rest = len(report["series"]) - len(panels)
    if rest > 0:
        body.append(_text(MARGIN + LEFT, top + FOOT + 18, f"and {rest} more series, of which nothing fired", "soft"))
    return "\n".join(_page(body, top + FOOT + MARGIN + (18 if rest > 0 else 0), report["robot"])) + "\n"


def _page(body: Iterable[str], height: float, robot: str) -> Iterator[str]:
    size = f'width="{WIDTH:g}" height="{height:g}" viewBox="0 0 {WIDTH:g} {height:g}"'
    label = _safe(f"What would have fired of {robot}")
    yield f'<svg xmlns="http://www.w3.org/2000/svg" {size} role="img" aria-label="{label}">'
    yield f"<style>{STYLE}</style>"
    yield f'<rect class="paper" width="{WIDTH:g}" height="{height:g}" rx="16"/>'
    yield from body
    yield "</svg>"


def _header(report: Mapping[str, Any]) -> Iterator[str]:
    begin, end = (report["span"][name][:16].replace("T", " ") for name in ("from", "to"))
    alerts, findings = len(report["alerts"]), len(report["findings"])
    fired = f"{alerts} alert{'s' * (alerts != 1)} of {findings} finding{'s' * (findings != 1)}" if alerts else "nothing"
    more = ", cut: there was more than a backtest may take" if report["cut"] else ""
    yield _text(MARGIN, MARGIN + 18, f"{report['robot']}: {fired} would have fired", "heading")
    said = f"{begin} – {end} UTC · {report['samples']:,} samples of {len(report['series'])} series{more}"
    yield _text(MARGIN, MARGIN + 38, said, "soft")
    yield from _legend({_severity(item) for item in (*report["findings"], *report["alerts"])})


def _legend(severities: set[str]) -> Iterator[str]:
    """What colours mean, from the right."""
    x, y = WIDTH - MARGIN - 10, MARGIN + 38
    for word in (*(word for word in ("info", "warning", "error") if word in severities), "expected"):
        yield _text(x, y, word, "soft end")
        x -= len(word) * 6.7 + 18
        swatch = f'x="{x:.1f}" y="{y - 9:g}" width="12" height="10" rx="3"'
        yield f'<rect class="{"band" if word == "expected" else word}" {swatch}/>'
        x -= 16


def _lanes(alerts: Sequence[Mapping[str, Any]], top: float, axis: Axis) -> Iterator[str]:
    """A bar an alert, from its first finding to the end of its last."""
    for number_, alert in enumerate(alerts):
        y = top + number_ * LANE
        first = axis.at(_ms(alert["first"]))
        last = axis.at(_ms(alert["last"])) if alert["last"] else axis.right
        why = f"{alert['severity']}: {alert['title']}\n{alert['reason']}\n{_lasted(alert)}"
        yield _text(axis.left - 10, y + 12, _short(alert["cause"], 10), "end")
        shape = f'x="{first:.1f}" y="{y + 3:.1f}" width="{max(5.0, last - first):.1f}" height="12" rx="4"'
        yield f'<rect class="bar {_severity(alert)}" {shape}>{_title(why)}</rect>'


def _panel(series: Mapping[str, Any], fired: Sequence[Mapping[str, Any]], frame: Frame) -> Iterator[str]:
    """One series: its band, its line, and where it fired."""
    points: Sequence[Point] = [point for point in series["points"] if point[1] is not None]
    axis, box = frame.time, f'width="{frame.time.right - frame.time.left:.1f}" height="{frame.height:g}"'
    values = _value_axis(points, frame)
    clip = f"c{frame.top:.0f}"
    yield _text(axis.left, frame.top - 8, _short(series["series"], 90), "name")
    yield _text(axis.right, frame.top - 8, f"{series['samples']:,} samples", "soft end")
    yield f'<clipPath id="{clip}"><rect x="{axis.left:g}" y="{frame.top:g}" {box} rx="8"/></clipPath>'
    yield f'<rect class="card" x="{axis.left:g}" y="{frame.top:g}" {box} rx="8"/>'
    for tick in value_ticks(values):
        y = values.at(tick)
        yield f'<path class="grid" d="M{axis.left:g} {y:.1f}H{axis.right:g}"/>'
        yield _text(axis.left - 10, y + 4, number(tick), "soft end")
    yield f'<g clip-path="url(#{clip})">'
    yield from (_span(item, frame) for item in fired)
    yield from (f'<path class="band" d="{path}"/>' for path in _bands(points, axis, values))
    yield from (f'<path class="line" d="{path}"/>' for path in _lines(points, axis, values))
    yield "</g>"
    for item in fired:
        yield from _mark(item, points, frame, values)


def _value_axis(points: Sequence[Point], frame: Frame) -> Axis:
    """All values, and of the band what does not make them small."""
    least = min((point[1] for point in points), default=0.0)
    most = max((point[1] for point in points), default=1.0)
    room = (most - least) or abs(most) * 0.1 or 1.0
    lows = [point[2] for point in points if point[2] is not None]
    highs = [point[3] for point in points if point[3] is not None]
    bottom = max(min([least, *lows]), least - room)
    top = min(max([most, *highs]), most + room)
    pad = (top - bottom) * 0.08 or room * 0.5
    return Axis(bottom - pad, top + pad, frame.bottom, frame.top)


def _bands(points: Sequence[Point], time: Axis, values: Axis) -> Iterator[str]:
    """The expected band: a shape for each stretch in which it is known."""
    for known, some in groupby(points, key=lambda point: point[2] is not None and point[3] is not None):
        stretch = list(some)
        if known and len(stretch) > 1:
            upper = [f"{time.at(p[0]):.1f} {_near(values, p[3]):.1f}" for p in stretch]
            lower = [f"{time.at(p[0]):.1f} {_near(values, p[2]):.1f}" for p in reversed(stretch)]
            yield f"M{'L'.join(upper)}L{'L'.join(lower)}Z"


def _lines(points: Sequence[Point], time: Axis, values: Axis) -> Iterator[str]:
    """The values; a hole in them is a hole in the line."""
    steps = sorted(after[0] - before[0] for before, after in pairwise(points))
    # Two points a span: the usual step is that between spans, not that within one.
    hole_ms = HOLE * max(steps[int(len(steps) * 0.8)], (time.end - time.begin) / 360) if steps else 0.0
    path = ""
    for before, point in zip([None, *points], points, strict=False):
        near = before is not None and point[0] - before[0] <= hole_ms
        if not near and path:
            yield path
            path = ""
        path += f"{'L' if path else 'M'}{time.at(point[0]):.1f} {values.at(point[1]):.1f}"
        if not near:
            path += f"L{time.at(point[0]):.1f} {values.at(point[1]):.1f}"  # a single one is a dot
    if path:
        yield path


def _span(item: Mapping[str, Any], frame: Frame) -> str:
    first = frame.time.at(_ms(item["at"]))
    last = frame.time.at(_ms(item["until"])) if item["until"] else frame.time.right
    shape = f'x="{first:.1f}" y="{frame.top:g}" width="{max(1.0, last - first):.1f}" height="{frame.height:g}"'
    return f'<rect class="span {_severity(item)}" {shape}/>'


def _mark(item: Mapping[str, Any], points: Sequence[Point], frame: Frame, values: Axis) -> Iterator[str]:
    """A dot where it fired, on the value that did it, and a rule through it."""
    at_ms = _ms(item["at"])
    x = frame.time.at(at_ms)
    near = min(points, key=lambda point: abs(point[0] - at_ms), default=None)
    value = item["value"] if item["value"] is not None else near[1] if near is not None else values.begin
    y = min(max(_near(values, value), frame.top + 6), frame.bottom - 6)
    why = f"{item['at'][:19].replace('T', ' ')} UTC, {item['detector']}, score {item['score']:.2f}\n{item['reason']}"
    severity = _severity(item)
    yield f'<path class="rule {severity}" d="M{x:.1f} {frame.top:g}V{frame.bottom:g}"/>'
    yield f'<circle class="mark {severity}" cx="{x:.1f}" cy="{y:.1f}" r="5">{_title(why)}</circle>'


def _times(axis: Axis, top: float, bottom: float) -> Iterator[str]:
    """The times below all panels."""
    for at_ms, label in time_ticks(axis):
        x = axis.at(at_ms)
        yield f'<path class="grid" d="M{x:.1f} {bottom - GAP:g}v6"/>'
        yield _text(x, bottom + 10, label, "soft middle")
    if bottom <= top:
        yield _text(axis.left, bottom + 30, "no series of that time is stored", "soft")


def _lasted(alert: Mapping[str, Any]) -> str:
    until = alert["last"][:19].replace("T", " ") if alert["last"] else "the end"
    return f"{alert['first'][:19].replace('T', ' ')} – {until} UTC, {alert['findings']} findings"


def _near(values: Axis, value: float) -> float:
    """Where a value is; what is far beyond the panel is just beyond it, so that no number is too long for a browser."""
    height = abs(values.right - values.left)
    return min(max(values.at(value), min(values.left, values.right) - height), max(values.left, values.right) + height)


def _severity(item: Mapping[str, Any]) -> str:
    return item["severity"] if item["severity"] in ("info", "warning", "error") else "error"


def _ms(time: str) -> float:
    return datetime.fromisoformat(time).timestamp() * 1e3


def _short(text: str, most: int) -> str:
    return text if len(text) <= most else f"{text[: most // 2]}…{text[-(most - most // 2 - 1) :]}"


def _text(x: float, y: float, text: str, class_: str) -> str:
    return f'<text x="{x:.1f}" y="{y:.1f}" class="{class_}">{_safe(text)}</text>'


def _title(text: str) -> str:
    return f"<title>{_safe(text)}</title>"


def _safe(text: str) -> str:
    """For XML: escaped, and without the characters that it does not know."""
    return escape(_UNPRINTABLE.sub("\ufffd", text))
