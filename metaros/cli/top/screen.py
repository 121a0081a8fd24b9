"""How `metaros top` looks: cells, headings, and the live screen, cut to the terminal's height."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING

from metaros.cli.shared.output import counted, human_bytes
from metaros.cli.top.drops import DROP_COLUMNS, drop_cells
from metaros.sanitize import sanitize

if TYPE_CHECKING:
    from rich.console import RenderableType
    from rich.table import Table

    from metaros.cli.top.rows import NodeRow, Screenful, TopicRow

__all__ = ["TOPIC_COLUMNS", "live", "node_cells", "node_columns", "render", "summary", "topic_cells"]

TOPIC_COLUMNS = ("Topic", "Type", "Hz", "Bandwidth", "Pub", "Sub")
NODE_COLUMNS = ("Node", "Pub", "Sub", "Srv", "PID", "CPU")
_FRAME_ROWS = 9  # headings, rules and empty lines around the rows
_DROP_FRAME_ROWS = 3
_DROP_RIGHT = tuple(range(2, len(DROP_COLUMNS)))
_LEAST_ROWS = 3


def topic_cells(row: TopicRow) -> tuple[str, ...]:
    """A topic in words; a dash where nothing comes."""
    rate = f"{row.rate_hz:.1f}" if row.rate_hz else "–"
    flow = f"{human_bytes(row.bytes_per_s)}/s" if row.bytes_per_s else "–"
    return row.topic, row.type, rate, flow, str(row.publishers), str(row.subscribers)


def node_cells(row: NodeRow) -> tuple[str, ...]:
    """A node in words; a dash where the system does not tell."""
    pid = "–" if row.pid is None else str(row.pid)
    cpu = "–" if row.cpu_percent is None else f"{row.cpu_percent:.0f} %"
    return row.node, str(row.publishers), str(row.subscribers), str(row.services), pid, cpu


def node_columns(screenful: Screenful) -> tuple[str, ...]:
    """The headings; those of processes only where any is known."""
    known = any(row.pid is not None for row in screenful.nodes)
    return NODE_COLUMNS if known else NODE_COLUMNS[:-2]


def summary(screenful: Screenful) -> str:
    """One line of totals."""
    rate, flow = (sum(getattr(row, name) for row in screenful.topics) for name in ("rate_hz", "bytes_per_s"))
    counts = f"{counted(len(screenful.nodes), 'node')}, {counted(len(screenful.topics), 'topic')}"
    text = f"{counts}, {rate:.0f} messages/s, {human_bytes(flow)}/s"
    if screenful.dropping:
        text = f"{text}, {sum(row.missing for row in screenful.dropping):,} missed"
    return f"{text}, ✗ {counted(screenful.mismatches, 'mismatch')}: see metaros graph" if screenful.mismatches else text


def live(look: Callable[[], Screenful], pause: Callable[[], None]) -> None:
    """Draw again after each pause, until Ctrl-C."""
    from rich.console import Console
    from rich.live import Live

    console = Console(highlight=False)
    pause()
    with Live(render(look(), console.height), console=console, screen=True, auto_refresh=False) as screen:
        while True:
            screen.refresh()
            pause()
            screen.update(render(look(), console.height))


def render(screenful: Screenful, height: int) -> RenderableType:
    """The tables, each with its share of `height` lines; who drops only while somebody does."""
    from rich.console import Group
    from rich.text import Text

    dropping = screenful.dropping
    drops = min(len(dropping), max(height // 5, _LEAST_ROWS))
    room = max(height - _FRAME_ROWS - (drops + _DROP_FRAME_ROWS if drops else 0), 2 * _LEAST_ROWS)
    nodes = min(len(screenful.nodes), max(room - len(screenful.topics), room // 3, _LEAST_ROWS))
    topics = max(room - nodes, _LEAST_ROWS)
    columns = node_columns(screenful)
    topic_rows = [topic_cells(row) for row in screenful.topics]
    node_rows = [node_cells(row)[: len(columns)] for row in screenful.nodes]
    parts: list[RenderableType] = [
        _table(TOPIC_COLUMNS, topic_rows, topics, right=(2, 3, 4, 5)),
        Text(),
        _table(columns, node_rows, nodes, right=tuple(range(1, len(columns)))),
    ]
    if drops:
        parts += [Text(), _table(DROP_COLUMNS, [drop_cells(row) for row in dropping], drops, right=_DROP_RIGHT)]
    title = Text.assemble(
        ("metaros top", "bold"),
        "  ",
        (summary(screenful), "red" if screenful.mismatches else "dim"),
        no_wrap=True,
        overflow="ellipsis",
    )
    return Group(title, Text(), *parts, Text("Ctrl-C ends", style="dim"))


def _table(columns: Sequence[str], rows: Sequence[Sequence[str]], limit: int, *, right: Sequence[int]) -> Table:
    from rich import box
    from rich.table import Table
    from rich.text import Text

    table = Table(box=box.SIMPLE_HEAD, header_style="bold", pad_edge=False, show_edge=False, expand=True)
    for number, column in enumerate(columns):
        table.add_column(
            column,
            style="cyan" if number == 0 else None,
            justify="right" if number in right else "left",
            no_wrap=True,
            ratio=None if number in right else 1,
        )
    shown = rows if len(rows) <= limit else rows[: limit - 1]
    for row in shown:
        table.add_row(*(Text(sanitize(cell), style="dim" if cell == "–" else "") for cell in row))
    if len(shown) < len(rows):
        table.add_row(Text(f"… and {len(rows) - len(shown)} more", style="dim"))
    return table
