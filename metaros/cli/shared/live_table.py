"""A table that is drawn in place while a bridge runs: names on the left, numbers on the right, zeros dim."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING, Final

if TYPE_CHECKING:
    from threading import Event

    from rich.console import RenderableType

__all__ = ["NONE", "draw", "table_of"]

NONE: Final = "–"  # instead of a zero
_WORDS: Final = 3  # columns before the numbers
_FRAME_ROWS: Final = 7  # headings and empty lines around the rows
_EVERY_S: Final = 0.5


def draw(render: Callable[[int], RenderableType], stop: Event) -> None:
    """Draw `render(height)` in place until `stop`; what is on the screen then stays there."""
    from rich.console import Console
    from rich.live import Live

    console = Console(highlight=False)
    with Live(render(console.height), console=console, auto_refresh=False) as screen:
        while not stop.wait(_EVERY_S):
            screen.update(render(console.height), refresh=True)


def table_of(
    columns: Sequence[str], rows: Sequence[Sequence[str]], *, height: int, faults: int, below: int = 0
) -> RenderableType:
    """The rows as a table, cut to `height` with `below` lines more beneath it; the last `faults` columns are red."""
    from rich import box
    from rich.table import Table
    from rich.text import Text

    table = Table(box=box.SIMPLE_HEAD, header_style="bold", pad_edge=False, show_edge=False)
    for number, column in enumerate(columns):
        justify = "right" if number >= _WORDS else "left"
        table.add_column(column, style="cyan" if number == 0 else None, justify=justify, no_wrap=True)  # type: ignore[arg-type]
    room = max(height - _FRAME_ROWS - below, 3)
    shown = rows if len(rows) <= room else rows[: room - 1]
    styles = [""] * (len(columns) - faults) + ["red"] * faults
    for row in shown:
        table.add_row(
            *(Text(cell, style="dim" if cell == NONE else style) for cell, style in zip(row, styles, strict=True))
        )
    if len(shown) < len(rows):
        table.add_row(Text(f"… and {len(rows) - len(shown)} more", style="dim"))
    return table
