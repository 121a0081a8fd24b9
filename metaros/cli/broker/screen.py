"""How `metaros broker` looks: one calm table while it runs, or a line for each topic that is new."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import asdict, dataclass
from typing import TYPE_CHECKING, Any

from metaros.cli.shared.live_table import NONE, draw, table_of
from metaros.cli.shared.output import counted, human_bytes
from metaros.cli.shared.topic_rates import RateMeter, TopicRates

if TYPE_CHECKING:
    from threading import Event

    from rich.console import RenderableType

    from metaros.broker import BrokerReport, TopicRow
    from metaros.clock import Clock

__all__ = ["Look", "Watcher", "live", "render", "report_facts"]

COLUMNS = ("Topic", "Type", "Direction", "msg/s", "Bandwidth", "Bridged", "Dropped", "Malformed")


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
    draw(lambda height: render(look(), height), stop)


def render(look: Look, height: int) -> RenderableType:
    """The table, cut to `height`, and a line of totals."""
    from rich.console import Group
    from rich.text import Text

    rows = [_cells(row, look.rates[row.topic, str(row.direction)]) for row in look.report.rows]
    waiting = Text("waiting for the first message or subscriber", style="dim")
    body = table_of(COLUMNS, rows, height=height, faults=2) if rows else waiting
    return Group(Text(), body, Text(), Text(_totals(look), style="dim"))


def _cells(row: TopicRow, rate: TopicRates) -> tuple[str, ...]:
    hz = f"{rate.hz:.1f}" if rate.hz else NONE
    flow = f"{human_bytes(rate.bytes_per_s)}/s" if rate.bytes_per_s else NONE
    bad = [str(count) if count else NONE for count in (row.dropped, row.malformed)]
    bridged = str(row.bridged) if row.heard or row.bridged else "nobody listens"
    return row.topic, row.type or NONE, str(row.direction), hz, flow, bridged, *bad


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
