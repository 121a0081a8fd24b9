"""`metaros alert backtest`: what would have fired over stored history, as a table, and as a plot."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from datetime import datetime
from pathlib import Path
from typing import Annotated, Any

import typer

from gateway.cli.alert.view import number, span, stamp
from metaros.cli.shared.gateway_http import GatewayClient, GatewayOption, open_gateway
from metaros.cli.shared.options import Format, FormatOption
from metaros.cli.shared.output import Output, counted, sanitize
from metaros.errors import ConfigError, UsageError
from metaros.limits import LIMITS

__all__ = ["register"]

BARS = "▁▂▃▄▅▆▇█"
CELLS = 40
MOST_LINES = 12
MARK = "▼"
SLACK_S = 60.0

Series = Annotated[
    list[str] | None,
    typer.Option("--series", metavar="GLOB", help="Only these, as battery_state.* or **.temperature; may be repeated."),
]
Checks = Annotated[
    list[str] | None,
    typer.Option(
        "--check",
        metavar="CHECK:FIELD=VALUE,…",
        help="With this change of a check: low, high, for_s, clear_s, severity, enabled; may be repeated.",
    ),
]
Detectors = Annotated[
    list[str] | None, typer.Option("--only", metavar="CHECK", help="With no check but this one; may be repeated.")
]


def register(noun: typer.Typer) -> None:
    """Add the verb to the noun."""
    noun.command("backtest")(_backtest)


def _backtest(
    robot: Annotated[str, typer.Argument(metavar="ROBOT", help="Whose stored history is judged.")],
    series: Series = None,
    start: Annotated[
        str, typer.Option("--start", "-s", metavar="TIME", help="RFC 3339, or relative like -12h.")
    ] = "-6h",
    end: Annotated[str, typer.Option("--end", "-e", metavar="TIME", help="RFC 3339, relative, or now.")] = "now",
    check: Checks = None,
    only: Detectors = None,
    svg: Annotated[Path | None, typer.Option("--svg", metavar="FILE", help="Draw it: an SVG of each series.")] = None,
    gateway: GatewayOption = "",
    output: FormatOption = Format.TEXT,
) -> None:
    """Judge the stored history of a robot, by the checks that hold now or by others, and say what would have fired.

    Nothing else changes: no alert opens, nobody is told, nothing is learned. The detectors begin to learn at --start.
    """
    out = Output(output)
    wanted = {
        "robot": robot,
        "series": series or [],
        "from": start,
        "to": end,
        "checks": _changes(check or []),
        "detectors": only or [],
    }
    if out.tty and not out.json:
        out.note("judging what is stored; a day of a robot takes some two minutes")
    patient = GatewayClient(open_gateway(gateway).url, timeout_s=LIMITS.backtest_s + SLACK_S)
    report = patient.post("/api/v1/backtests", wanted)
    if svg is not None:
        _draw(report, svg)
    if out.json:
        out.objects(report)
        return
    _show(out, report)
    if svg is not None:
        out.note(f"drawn in {svg}")


def _changes(texts: Sequence[str]) -> dict[str, dict[str, Any]]:
    """`battery_low:low=20,for_s=5` as {"battery_low": {"low": 20, "for_s": 5}}."""
    found: dict[str, dict[str, Any]] = {}
    for text in texts:
        name, colon, fields = text.partition(":")
        pairs = [pair.partition("=") for pair in fields.split(",")]
        if not (name and colon and all(key and sign for key, sign, _ in pairs)):
            raise UsageError(f"--check {text}: not CHECK:FIELD=VALUE,…, as battery_low:low=20,for_s=5")
        found.setdefault(name, {}).update({key: _value(value) for key, _, value in pairs})
    return found


def _value(text: str) -> Any:
    """JSON, else a text; none is no bound."""
    try:
        return None if text == "none" else json.loads(text)
    except ValueError:
        return text


def _draw(report: Mapping[str, Any], path: Path) -> None:
    from gateway.alerting.backtest.plot import plot_svg

    try:
        path.write_text(plot_svg(report))
    except OSError as error:
        raise ConfigError(f"cannot write {path}: {error.strerror or error}") from error


def _show(out: Output, report: Mapping[str, Any]) -> None:
    """A line of each series with a mark where it fired, then the alerts that would have been."""
    begin, end = (stamp(report["span"][name]) for name in ("from", "to"))
    samples = f"{report['samples']:,} samples of {len(report['series'])} series".replace(",", " ")
    out.line(
        f"{out.style(sanitize(report['robot']), '1')}  {begin} – {end} UTC  {samples}  in {report['took_s']:.1f} s"
    )
    if report["cut"]:
        out.note("that is as much as one backtest may take: ask for fewer series, or go on at the time where it ended")
    out.line()
    for series in report["series"][:MOST_LINES]:
        fired = [item for item in report["findings"] if item["series"] == series["series"]]
        _sparkline(out, series, fired, report["span"])
    if len(report["series"]) > MOST_LINES:
        out.note(f"  and {len(report['series']) - MOST_LINES} more series; --svg FILE draws them")
    if not report["alerts"]:
        out.line(f"{out.style('✓', '32')} nothing would have fired")
        return
    out.line()
    names = ("Cause", "Severity", "From (UTC)", "Lasted", "Findings", "Why")
    out.table(names, [_row(item, report) for item in report["alerts"]], right=(4,))
    found = f"{counted(len(report['alerts']), 'alert')} of {counted(len(report['findings']), 'finding')}"
    out.note(f"{found} would have fired")


def _row(item: Mapping[str, Any], report: Mapping[str, Any]) -> Sequence[object]:
    last = item["last"] or report["span"]["to"]
    lasted = span(max(0.0, _s(last) - _s(item["first"]))) if last != item["first"] else "0 s"
    lasted = lasted if item["last"] else f"{lasted}, and on"
    return (item["cause"], item["severity"], stamp(item["first"]), lasted, item["findings"], item["reason"])


def _sparkline(
    out: Output, series: Mapping[str, Any], fired: Sequence[Mapping[str, Any]], span: Mapping[str, str]
) -> None:
    """The series as a line of blocks, and above it a mark where something fired."""
    begin_s, end_s = _s(span["from"]), _s(span["to"])
    width_s = max(end_s - begin_s, 1e-9)

    def cell(at_s: float) -> int:
        return min(CELLS - 1, max(0, int((at_s - begin_s) / width_s * CELLS)))

    cells: list[list[float]] = [[] for _ in range(CELLS)]
    for point in series["points"]:
        cells[cell(point[0] / 1e3)].append(point[1])
    values = [value for some in cells for value in some]
    least, most = min(values, default=0.0), max(values, default=0.0)
    rise, middle = (most - least) or 1.0, (most + least) / 2
    marks = {cell(_s(item["at"])) for item in fired}
    line = ""
    for place, some in enumerate(cells):
        level = round((max(some, key=lambda v: abs(v - middle)) - least) / rise * (len(BARS) - 1)) if some else -1
        block = BARS[level] if level >= 0 else " "
        line += out.style(block, "1;31") if place in marks else out.style(block, "36") if level >= 0 else block
    name = series["series"] if len(series["series"]) <= 40 else f"…{series['series'][-39:]}"
    if marks:
        above = "".join(MARK if place in marks else " " for place in range(CELLS)).rstrip()
        out.line(f"  {' ' * 40}  {out.style(above, '1;31')}")
    out.line(f"  {sanitize(name).ljust(40)}  {line}  {number(least)} to {number(most)}")


def _s(time: str) -> float:
    return datetime.fromisoformat(time).timestamp()
