"""The results as text: the cells once, for a terminal (rich) and for a page (Markdown)."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

from rich import box
from rich.console import Console, Group, RenderableType
from rich.table import Table
from rich.text import Text

from load_tests.peers.goals import Verdict, judge, ratio
from load_tests.peers.results import Cell, Results
from load_tests.peers.rows import ROWS, size_name

__all__ = ["COST", "SPEED", "TITLES", "as_markdown", "as_terminal", "cost_cells", "print_results", "speed_cells"]

SPEED = ("msg/s", "min..max", "÷ raw", "arrived", "RTT p50 µs", "p99 µs")
COST = ("CPU µs pub+sub", "threads", "resident MiB", ".so MiB", "wire ÷ payload", "alone +B", "20 subs: threads")
TITLES = {"speed": "How fast", "cost": "What it costs (publisher / subscriber)"}
_NONE = "–"
_MIB = 1 << 20
_ERROR_CHARS = 110


def _number(value: float | None, digits: int = 0) -> str:
    return _NONE if value is None else f"{value:,.{digits}f}"


def _rate(value: float) -> str:
    """1,234,567 or 12.3: three digits are known at best."""
    return f"{value:,.0f}" if value >= 100 else f"{value:.1f}"


def speed_cells(cell: Cell, raw_rate: float | None) -> list[str]:
    """The columns of SPEED."""
    rates, rate = cell.values("rate"), cell.median("rate")
    share = ratio(rate, raw_rate)
    return [
        _NONE if rate is None else _rate(rate),
        f"{_rate(min(rates))}..{_rate(max(rates))}" if rates else _NONE,
        _NONE if share is None else f"{share:.2f}" if share >= 0.01 else f"{share:.5f}",
        _NONE if cell.arrived is None else f"{cell.arrived:.0%}" if cell.arrived >= 0.01 else "< 1%",
        _number(cell.median("p50_us")),
        _number(cell.median("p99_us")),
    ]


def _pair(cell: Cell, name: str, *, scale: float = 1.0, digits: int = 0, between: str = "/") -> str:
    """A figure of the publisher and of the subscriber."""
    both = [cell.median(f"{name}_{side}") for side in ("pub", "sub")]
    if both == [None, None]:
        return _NONE
    return between.join(_NONE if value is None else f"{value / scale:,.{digits}f}" for value in both)


def _alone(extra: float | None, size: int) -> str:
    """Bytes beyond the payload; all of them where the payload did not take the wire."""
    if extra is not None and extra < 0:
        return f"{size + extra:,.0f} in all"
    return _number(extra)


def cost_cells(cell: Cell, size: int, many: Cell | None) -> list[str]:
    """The columns of COST."""
    cpu = [cell.median("cpu_pub_us"), cell.median("cpu_sub_us")]
    digits = 1 if all(value is None or value < 100 for value in cpu) else 0
    spent = "+".join(_number(value, digits) for value in cpu) if cpu != [None, None] else _NONE
    wire = cell.median("wire")
    return [
        spent,
        _pair(cell, "threads"),
        _pair(cell, "resident", scale=_MIB),
        _pair(cell, "objects", scale=_MIB),
        _number(wire, 2),
        _alone(cell.median("extra_bytes"), size),
        _number(many.median("threads_sub")) if many else "",
    ]


def _lines(results: Results, kind: str, size: int) -> Iterator[tuple[str, list[str], str]]:
    """Label, cells and error of each row at a size."""
    raw_rate = results.median(size, "zenoh", "rate")
    for row, cell in results.rows_at(size):
        if kind == "speed":
            cells = speed_cells(cell, raw_rate)
        else:
            cells = cost_cells(cell, size, results.many.get(row.key) if size == results.sizes[0] else None)
        measured = bool(cell.flood or cell.ping)
        error = cell.errors[-1] if cell.errors and not measured else ""
        yield row.label, cells, error[:_ERROR_CHARS]


def _partial(results: Results) -> list[str]:
    """Cells that failed in some rounds only, and why at last."""
    labels = {row.key: row.label for row in ROWS}
    return [
        f"{labels[key]} at {size_name(size)}: {len(cell.errors)} runs failed, at last: {cell.errors[-1]}"
        for (size, key), cell in results.cells.items()
        if cell.errors and (cell.flood or cell.ping)
    ]


def _footer(results: Results) -> list[str]:
    """What the figures are, in words."""
    machine, (busy, runs) = results.machine, results.disturbed()
    lines = [
        f"medians of {results.done} interleaved rounds of {results.seconds:g} s, two processes over loopback; "
        f"{machine['cores']} × {machine['cpu']}, Python {machine['python']}, eclipse-zenoh {machine['zenoh']}",
        "raw: zenoh with a 33-byte attachment; alone +B: bytes on the wire beyond the payload of one message by itself",
    ]
    if busy:
        lines.append(f"{busy} of {runs} runs had other processes busy beside them: repeat them on a quiet machine")
    return lines + _partial(results)


# -- terminal ----------------------------------------------------------------------------------------------------------


def _table(results: Results, kind: str, columns: Sequence[str]) -> Table:
    """One section a size."""
    table = Table(title=TITLES[kind], title_style="bold", title_justify="left", box=box.SIMPLE_HEAD, pad_edge=False)
    table.add_column("", no_wrap=True)
    for column in columns:
        table.add_column(column, justify="right", no_wrap=True)
    for size in results.sizes:
        table.add_row(Text(size_name(size), style="bold cyan"))
        for label, cells, error in _lines(results, kind, size):
            ours = label.startswith("metaros ") and "PyPI" not in label
            shown = Text(f"  {label}", style="green" if ours else "")
            if error:
                table.add_row(shown, Text("failed", style="red"))
            else:
                table.add_row(shown, *cells)
        table.add_section()
    return table


def _failures(results: Results) -> Iterator[Text]:
    """The rows that gave nothing, with their reasons, each once."""
    reported = dict.fromkeys(
        (label, error) for size in results.sizes for label, _, error in _lines(results, "speed", size) if error
    )
    yield from (Text(f"{label}: {error}", style="red") for label, error in reported)


def _goal_table(verdicts: Sequence[Verdict]) -> Table:
    table = Table(title="Goals", title_style="bold", title_justify="left", box=box.SIMPLE_HEAD, pad_edge=False)
    table.add_column("", no_wrap=True)
    for column in ("goal", "measured"):
        table.add_column(column, justify="right", no_wrap=True)
    table.add_column("", no_wrap=True)
    for verdict in verdicts:
        said = {True: ("reached", "green"), False: ("not reached", "red"), None: ("", "dim")}[verdict.reached]
        table.add_row(verdict.text, verdict.goal, verdict.figure, Text(*said))
    return table


def as_terminal(results: Results) -> RenderableType:
    """Both tables, the goals and the notes."""
    notes = [Text(line, style="dim") for line in _footer(results)]
    speed, cost = _table(results, "speed", SPEED), _table(results, "cost", COST)
    return Group(speed, cost, *_failures(results), Text(), _goal_table(judge(results)), *notes)


def print_results(results: Results, console: Console) -> None:
    """As wide as the tables need where nobody watches."""
    if not console.is_terminal:
        console.width = max(console.width, 140)
    console.print(as_terminal(results))


# -- Markdown ----------------------------------------------------------------------------------------------------------


def _markdown_table(columns: Sequence[str], rows: Sequence[Sequence[str]]) -> list[str]:
    head = f"| {' | '.join(columns)} |"
    rule = f"| --- |{' ---: |' * (len(columns) - 1)}"
    return [head, rule, *(f"| {' | '.join(cell.replace('|', '/') for cell in row)} |" for row in rows)]


def as_markdown(results: Results) -> str:
    """The same for docs."""
    lines: list[str] = []
    for kind, columns in (("speed", SPEED), ("cost", COST)):
        lines += [f"### {TITLES[kind]}", ""]
        for size in results.sizes:
            found = list(_lines(results, kind, size))
            if size != results.sizes[0] and kind == "cost":
                columns, found = COST[:-1], [(label, cells[:-1], error) for label, cells, error in found]
            rows = [[label, *([f"failed: {error}"] if error else cells)] for label, cells, error in found]
            rows = [row + [""] * (len(columns) + 1 - len(row)) for row in rows]
            lines += [f"**{size_name(size)}**", "", *_markdown_table(["", *columns], rows), ""]
    said = {True: "reached", False: "**not reached**", None: ""}
    verdicts = [[v.text, v.goal, v.figure, said[v.reached]] for v in judge(results)]
    lines += ["### Goals", "", *_markdown_table(["", "goal", "measured", ""], verdicts), ""]
    return "\n".join([*lines, *(f"* {line}" for line in _footer(results)), ""])
