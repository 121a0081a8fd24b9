"""What `metaros launch` shows: the nodes' output, each line under its node's name, what happens to the nodes, and on a
terminal a table of them below, kept up to date.
"""

from __future__ import annotations

import contextlib
import sys
from collections import Counter
from collections.abc import Mapping, Sequence
from datetime import datetime
from typing import TYPE_CHECKING, Any, Final

from metaros.cli.launch.process_meters import Meters
from metaros.cli.shared.output import human_bytes, human_seconds
from metaros.clock import Clock
from metaros.supervise import Event, EventKind, LaunchTable, ProcessStatus

if TYPE_CHECKING:
    from rich.live import Live
    from rich.padding import Padding

    from metaros.cli.launch.plan import Place

__all__ = ["Screen", "status_rows"]

_COLOURS: Final = ("cyan", "magenta", "green", "blue", "yellow", "bright_cyan", "bright_magenta", "bright_green")
_STATES: Final = {  # how a state looks
    "running": ("●", "green"),
    "starting": ("◌", "cyan"),
    "blocked": ("◌", "dim"),
    "waiting": ("↻", "yellow"),
    "hung": ("!", "red"),
    "quarantined": ("✗", "red"),
    "ended": ("○", "dim"),
    "stopped": ("○", "dim"),
}
_TAIL: Final = 4  # last lines shown again with a death
_LINES_PER_S: Final = 50  # of one node on the screen; all are in its log: printing must not hold up the supervisor


class Screen:
    """Prints to stdout: colours and the live table on a terminal, plain lines otherwise."""

    def __init__(self, table: LaunchTable, *, clock: Clock, plain: bool = False) -> None:
        from rich.console import Console

        self._console = Console(highlight=False, soft_wrap=True)
        self._clock = clock
        self._live: Live | None = None
        self._tty = self._console.is_terminal and not plain
        self._meters = Meters()
        self._rows: Sequence[ProcessStatus] = ()
        self._ended_at: dict[str, float] = {}  # when a pause is over, by name
        self._printed: Counter[str] = Counter()  # lines since the last refresh, by name
        self._since_s = clock.monotonic_s()
        names = [row.name for row in table.nodes]
        self._colours = {name: _COLOURS[number % len(_COLOURS)] for number, name in enumerate(names)}
        self._width = max(map(len, names))
        self._table = table

    def title(self, place: Place, *, hosted: bool) -> None:
        """The first lines."""
        count = len(self._table.nodes)
        nodes = "1 node" if count == 1 else f"{count} nodes"
        router = "router hosted here" if hosted else "router joined"
        where = f"{nodes} · tcp/127.0.0.1:{place.zenoh_port} ({router}) · ROS domain {place.domain}"
        self._print(f"\n  [bold]{_escape(self._table.path.name)}[/bold] [dim]{where}[/dim]")
        self._print(f"  [dim]logs in {_escape(str(place.log_dir))} · Ctrl-C stops all[/dim]\n")

    def line(self, name: str, text: str) -> None:
        """A line that a node wrote; of a flood only the beginning."""
        self._printed[name] += 1
        if self._printed[name] <= _LINES_PER_S:
            self._print(f"{self._prefix(name)}[dim]│[/] {_escape(text)}")

    def _end_second(self) -> None:
        now = self._clock.monotonic_s()
        if now - self._since_s >= 1.0:
            for name, count in self._printed.items():
                if count > _LINES_PER_S:
                    self._print(f"{self._prefix(name)}[dim]│ … {count - _LINES_PER_S} more lines, in its log[/]")
            self._printed.clear()
            self._since_s = now

    def note(self, text: str) -> None:
        """Something that the launcher did or noticed."""
        self._print(f"[yellow]![/] {self._stamp()} {_escape(text)}")

    def event(self, event: Event, tail: Sequence[str]) -> None:
        """What happened to a node; a death with the last lines that it wrote."""
        text = self._event_text(event)
        if not text:
            return
        self._print(f"{self._prefix(event.name)}{text}")
        if event.kind is EventKind.EXITED and tail and not event.detail.endswith(("exited", tail[-1])):
            for line in tail[-_TAIL:]:
                self._print(f"{self._prefix(event.name)}  [dim]last: {_escape(line)}[/]")

    def _event_text(self, event: Event) -> str:
        detail = _escape(event.detail)
        match event.kind:
            case EventKind.STARTED:
                again = f"restarted, time {event.restarts}" if event.restarts else "started"
                return f"[green]▶[/] {again} [dim](pid {event.pid})[/]"
            case EventKind.READY if event.detail:
                return f"[yellow]![/] {detail}"
            case EventKind.EXITED:
                good = event.detail == "exited"
                return f"[{'dim' if good else 'red'}]■ {detail}[/]"
            case EventKind.RESTARTING:
                self._ended_at[event.name] = self._clock.monotonic_s() + event.delay_s
                return f"[yellow]↻[/] again in {event.delay_s:.1f} s" if event.delay_s >= 0.1 else ""
            case EventKind.HUNG:
                return f"[red]■ {detail}: asked to end[/]"
            case EventKind.QUARANTINED:
                self._ended_at[event.name] = self._clock.monotonic_s() + event.delay_s
                wait = human_seconds(event.delay_s)
                now = f"metaros launch restart {event.name}"
                return f"[bold red]✗ quarantined[/]: {detail}; one try in {wait}, or: {now}"
            case EventKind.ENDED:
                return f"[dim]○ not started again: {detail}[/]"
            case EventKind.SAFE_STOP:
                return f"[bold red]! safe stop[/]: {detail}"
            case EventKind.STOPPED:
                return "[dim]○ stopped[/]"
            case EventKind.KILLED:
                return "[yellow]○ did not stop in time: killed[/]"
        return ""

    # -- the live table --------------------------------------------------------------------------------------------

    def refresh(self, rows: Sequence[ProcessStatus]) -> None:
        """Show the nodes as they are now."""
        self._rows = rows
        self._end_second()
        if not self._tty:
            return
        if self._live is None:
            from rich.live import Live

            self._live = Live(console=self._console, auto_refresh=False, transient=True)
            self._live.start()
        with contextlib.suppress(OSError):
            self._live.update(self._view(), refresh=True)

    def _view(self) -> Padding:
        from rich import box
        from rich.padding import Padding
        from rich.table import Table
        from rich.text import Text

        table = Table(box=box.SIMPLE_HEAD, header_style="dim", pad_edge=False, show_edge=False)
        for name in ("node", "state", "pid", "up", "restarts", "cpu", "mem"):
            table.add_column(name, justify="left" if name in ("node", "state") else "right", no_wrap=True)
        table.add_column("last exit", overflow="ellipsis", no_wrap=True)
        usages = self._meters.look({row.name: row.pid for row in self._rows if row.pid})
        now = self._clock.monotonic_s()
        for row in self._rows:
            word = "starting" if row.state == "running" and not row.ready else row.state
            mark, style = _STATES.get(word, ("?", "red"))
            note = f" for {row.waits_for}" if row.waits_for else self._left(row, now)
            usage = usages.get(row.name)
            table.add_row(
                Text(row.name + (" ★" if row.critical else ""), style=self._colours[row.name]),
                Text(f"{mark} {'waits' if row.state == 'blocked' else word}{note}", style=style),
                str(row.pid or ""),
                human_seconds(now - row.started_at) if row.started_at is not None else "",
                str(row.restarts or ""),
                f"{usage.cpu_percent:.0f} %" if usage else "",
                human_bytes(usage.memory_bytes) if usage else "",
                Text(row.last_exit, style="dim"),
            )
        return Padding(table, (1, 0, 0, 0))

    def _left(self, row: ProcessStatus, now: float) -> str:
        left = self._ended_at.get(row.name, now) - now
        return f", {human_seconds(left)}" if row.state in ("quarantined", "waiting") and left >= 1 else ""

    def stopping(self) -> None:
        """All are being ended."""
        self._end_live()
        if self._console.is_terminal:
            with contextlib.suppress(OSError):
                sys.stdout.write("\r\x1b[2K")  # the ^C that the terminal echoed
        self._print("[dim]stopping …[/]")

    def stopped(self, rows: Sequence[ProcessStatus]) -> None:
        """The last line."""
        restarts = sum(row.restarts for row in rows)
        self._print(f"stopped[dim], {restarts or 'no'} restart{'' if restarts == 1 else 's'} in all[/]")

    def _end_live(self) -> None:
        if self._live is not None:
            with contextlib.suppress(OSError):
                self._live.stop()
            self._live = None

    def _prefix(self, name: str) -> str:
        return f"[{self._colours.get(name, 'white')}]{name:<{self._width}}[/] "

    def _stamp(self) -> str:
        return f"[dim]{datetime.fromtimestamp(self._clock.wall_ns() / 1e9):%H:%M:%S}[/]"

    def _print(self, text: str) -> None:
        with contextlib.suppress(OSError):  # the reader or the terminal may be gone; the robot must not care
            self._console.print(text)
            sys.stdout.flush()


def status_rows(nodes: Sequence[Mapping[str, Any]]) -> list[list[str]]:
    """Rows of `metaros launch status`."""
    return [
        [
            str(node["name"]),
            str(node["state"]) + (f" for {node['waits_for']}" if node.get("waits_for") else ""),
            str(node["pid"] or "-"),
            str(node["restarts"]),
            str(node["last_exit"] or "-"),
        ]
        for node in nodes
    ]


def _escape(text: str) -> str:
    from rich.markup import escape

    # A node's control characters could rewrite the terminal.
    return escape("".join(char if char.isprintable() or char == "\t" else "·" for char in text))
