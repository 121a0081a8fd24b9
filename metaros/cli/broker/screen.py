"""How `metaros broker` looks: one calm table while it runs, or a line for each topic that is new."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import asdict, dataclass
from typing import TYPE_CHECKING, Any

from metaros.cli.shared.output import counted, human_bytes
from metaros.cli.shared.topic_rates import RateMeter, TopicRates

if TYPE_CHECKING:
    from threading import Event

    from rich.console import RenderableType

    from metaros.broker import BrokerReport, TopicRow
    from metaros.clock import Clock

__all__ = ["Look", "Watcher", "live", "render", "report_facts"]

COLUMNS = ("Topic", "Type", "Direction", "msg/s", "Bandwidth", "Bridged", "Dropped", "Malformed")
_FRAME_ROWS = 7  # headings and empty lines around the rows
_EVERY_S = 0.5


@dataclass(frozen=True, slots=True)
class Look:
    """A report with the rates of its counters."""

    report: BrokerReport
    rates: dict[tuple[str, str], TopicRates]
    hub: TopicRates


class Watcher:
    """Turns reports into rates and news."""

    def __init__(self, clock: Clock) -> None:
        self._clock = clock
        self._meter = RateMeter()
        self._announced: set[tuple[str, str, str]] = set()

    def look(self, report: BrokerReport) -> Look:
        """The rates since some looks ago."""
        counts = {_key(row): (row.messages, row.bytes) for row in report.rows}
        counts[""] = (report.hub_frames, report.hub_bytes)
        rates = self._meter.look(self._clock.monotonic_s(), counts)
        none = TopicRates(0.0, 0.0)
        by_row = {(row.topic, str(row.direction)): rates.get(_key(row), none) for row in report.rows}
        return Look(report, by_row, rates.get("", none))

    def news(self, report: BrokerReport) -> list[str]:
        """A line for each topic, direction and type that was not there at the last call."""
        lines = []
        for row in report.rows:
            about = row.topic, str(row.direction), row.type
            if row.type and about not in self._announced:
                self._announced.add(about)
                lines.append(f"{row.direction}  {row.topic}  {row.type}")
        return lines


def _key(row: TopicRow) -> str:
    return f"{row.topic} {row.direction}"


def report_facts(look: Look) -> dict[str, Any]:
    """For machines."""
    facts = asdict(look.report)
    for fact, row in zip(facts["rows"], look.report.rows, strict=True):
        rate = look.rates[row.topic, str(row.direction)]
        fact |= {"direction": row.direction.name.lower(), "rate_hz": rate.hz, "bytes_per_s": rate.bytes_per_s}
    return facts


def live(look: Callable[[], Look], stop: Event) -> None:
    """Draw in place until `stop`; what is on the screen then stays there."""
    from rich.console import Console
    from rich.live import Live

    console = Console(highlight=False)
    with Live(render(look(), console.height), console=console, auto_refresh=False) as screen:
        while not stop.wait(_EVERY_S):
            screen.update(render(look(), console.height), refresh=True)


def render(look: Look, height: int) -> RenderableType:
    """The table, cut to `height`, and a line of totals."""
    from rich import box
    from rich.console import Group
    from rich.table import Table
    from rich.text import Text

    table = Table(box=box.SIMPLE_HEAD, header_style="bold", pad_edge=False, show_edge=False)
    for number, column in enumerate(COLUMNS):
        justify = "right" if number > 2 else "left"
        table.add_column(column, style="cyan" if number == 0 else None, justify=justify, no_wrap=True)  # type: ignore[arg-type]
    rows, room = look.report.rows, max(height - _FRAME_ROWS, 3)
    shown = rows if len(rows) <= room else rows[: room - 1]
    for row in shown:
        cells = _cells(row, look.rates[row.topic, str(row.direction)])
        bad = (row.dropped, row.malformed)
        styles = [""] * 6 + ["red" if count else "dim" for count in bad]
        table.add_row(
            *(Text(cell, style="dim" if cell == "–" else style) for cell, style in zip(cells, styles, strict=True))
        )
    if len(shown) < len(rows):
        table.add_row(Text(f"… and {len(rows) - len(shown)} more", style="dim"))
    body = table if rows else Text("waiting for the first message or subscriber", style="dim")
    return Group(Text(), body, Text(), Text(_totals(look), style="dim"))


def _cells(row: TopicRow, rate: TopicRates) -> tuple[str, ...]:
    hz = f"{rate.hz:.1f}" if rate.hz else "–"
    flow = f"{human_bytes(rate.bytes_per_s)}/s" if rate.bytes_per_s else "–"
    bad = [str(count) if count else "–" for count in (row.dropped, row.malformed)]
    bridged = str(row.bridged) if row.heard or row.bridged else "nobody listens"
    return row.topic, row.type or "–", str(row.direction), hz, flow, bridged, *bad


def _totals(look: Look) -> str:
    report = look.report
    text = (
        f"{counted(len(report.subscriptions), 'ZeroMQ subscription')}   "
        f"hub: {look.hub.hz:.0f} frames/s, {human_bytes(look.hub.bytes_per_s)}/s"
    )
    if report.unreadable:
        text += f"   {report.unreadable} without a ROS topic"
    if report.hub_missed:
        text += f"   {report.hub_missed} too fast for the bridge"
    return text
