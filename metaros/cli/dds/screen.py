"""How `metaros dds` looks: one calm table while it runs, or a line for each route that is new."""

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

    from metaros.clock import Clock
    from metaros.dds import DdsReport, RouteRow

__all__ = ["Look", "Watcher", "live", "render", "report_facts"]

COLUMNS = ("Name", "Type", "Direction", "msg/s", "Bandwidth", "Bridged", "Dropped", "Failed")


@dataclass(frozen=True, slots=True)
class Look:
    """A report with the rates of its counters."""

    report: DdsReport
    rates: dict[str, TopicRates]

    def rate(self, row: RouteRow) -> TopicRates:
        """Of one row."""
        return self.rates.get(_key(row), TopicRates(0.0, 0.0))


class Watcher:
    """Turns reports into rates and news."""

    def __init__(self, clock: Clock) -> None:
        self._clock = clock
        self._meter = RateMeter()
        self._announced: set[str] = set()

    def look(self, report: DdsReport) -> Look:
        """The rates since some looks ago."""
        counts = {_key(row): (row.bridged, row.bytes) for row in report.rows}
        return Look(report, self._meter.look(self._clock.monotonic_s(), counts))

    def news(self, report: DdsReport) -> list[str]:
        """A line for each route, and each problem, that was not there at the last call."""
        lines = [f"{row.direction}  {row.name}  {row.type}" for row in report.rows]
        lines += [f"not bridged: {problem}" for problem in report.problems]
        new = [line for line in lines if line not in self._announced]
        self._announced.update(new)
        return new


def _key(row: RouteRow) -> str:
    return f"{row.name} {row.direction}"


def report_facts(look: Look) -> dict[str, Any]:
    """For machines."""
    facts = asdict(look.report)
    for fact, row in zip(facts["rows"], look.report.rows, strict=True):
        rate = look.rate(row)
        fact |= {"direction": row.direction.name.lower(), "rate_hz": rate.hz, "bytes_per_s": rate.bytes_per_s}
    return facts


def live(look: Callable[[], Look], stop: Event) -> None:
    """Draw in place until `stop`; what is on the screen then stays there."""
    draw(lambda height: render(look(), height), stop)


def render(look: Look, height: int) -> RenderableType:
    """The table, cut to `height`, what is not bridged, and a line of totals."""
    from rich.console import Group
    from rich.text import Text

    problems, rows = look.report.problems, [_cells(row, look.rate(row)) for row in look.report.rows]
    waiting = Text("waiting for a robot on DDS", style="dim")
    body = table_of(COLUMNS, rows, height=height, faults=2, below=len(problems)) if rows else waiting
    told = [Text(f"not bridged: {problem}", style="yellow") for problem in problems]
    totals = f"{counted(look.report.participants, 'DDS participant')}   {counted(len(rows), 'route')}"
    return Group(Text(), body, Text(), *told, Text(totals, style="dim"))


def _cells(row: RouteRow, rate: TopicRates) -> tuple[str, ...]:
    hz = f"{rate.hz:.1f}" if rate.hz else NONE
    flow = f"{human_bytes(rate.bytes_per_s)}/s" if rate.bytes_per_s else NONE
    counts = [str(count) if count else NONE for count in (row.bridged, row.dropped, row.failed)]
    return row.name, row.type, str(row.direction), hz, flow, *counts
