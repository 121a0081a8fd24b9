"""`-w`: a list that is shown again and again, in its place on a terminal, in a pipe each time it has changed."""

from __future__ import annotations

import contextlib
import sys
from collections.abc import Callable
from typing import TYPE_CHECKING, Annotated, Any

import typer

from metaros.concurrency.waiting import pause

if TYPE_CHECKING:
    from metaros.cli.shared.output import Output

__all__ = ["WatchOption", "watch"]

EVERY_S = 2.0
HOME = "\x1b[H\x1b[2J"

WatchOption = Annotated[bool, typer.Option("--watch", "-w", help="Show it again and again, until Ctrl-C.")]


def watch(out: Output, find: Callable[[], Any], show: Callable[[Any], None], *, again: bool) -> None:
    """Find and show; with `again` every two seconds. Machines get one value, or document, for each change."""
    found = find()
    if not again:
        show(found)
        return
    before: Any = object()
    with contextlib.suppress(KeyboardInterrupt):
        while True:
            if out.json:
                if found != before:
                    out.object_line(found)
            elif out.tty:
                sys.stdout.write(HOME)
                show(found)
            elif found != before:
                show(found)
                out.line()
            before = found
            pause(EVERY_S)
            found = find()
