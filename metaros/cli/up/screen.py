"""What `metaros up` shows: a line a step while it starts, one clear screen when it is ready, a line an event after."""

from __future__ import annotations

import contextlib
import sys
import threading
from datetime import datetime
from typing import TYPE_CHECKING

from metaros.cli.shared.options import DEFAULT_ZENOH_PORT
from metaros.clock import Clock
from metaros.supervise import Event, EventKind

if TYPE_CHECKING:
    from rich.status import Status

    from metaros.cli.up.launch_table import Plan

__all__ = ["Screen"]

LABELS = {"router": "Zenoh router", "gateway": "Gateway", "simulator": "Simulator", "robots": "Robots"}
WIDTH = 11


class Screen:
    """Prints to stdout; colours and a spinner on a terminal, plain lines otherwise."""

    def __init__(self, *, clock: Clock) -> None:
        from rich.console import Console

        self._console = Console(highlight=False, soft_wrap=True)
        self._clock = clock
        self._status: Status | None = None
        self._lock = threading.Lock()  # progress is told from the thread that asks the gateway
        self._step_s = clock.monotonic_s()

    def title(self, version: str) -> None:
        """The first line."""
        self._print(f"\n  [bold]Meta-ROS[/bold] [dim]{version}[/dim]\n")

    def note(self, text: str) -> None:
        """Something the user should know: a port that moved, a router that was joined."""
        self._print(f"  [yellow]![/yellow] {_escape(text)}")

    def begin(self, what: str) -> None:
        """A step begins; one that was not finished is over."""
        self._end_status()
        self._step_s = self._clock.monotonic_s()
        if self._console.is_terminal:
            self._status = self._console.status(f" {LABELS[what]}", spinner="dots", spinner_style="cyan")
            self._status.start()

    def progress(self, what: str, text: str) -> None:
        """How far the running step is."""
        with self._lock:
            if self._status:
                self._status.update(f" {LABELS[what]}  [dim]{_escape(text)}[/dim]")

    def done(self, what: str) -> None:
        """The step is finished."""
        self._end_status()
        took = self._clock.monotonic_s() - self._step_s
        self._print(f"  [green]✓[/green] {LABELS[what]:<14}[dim]{took:4.1f} s[/dim]")

    def ready(self, plan: Plan, took_s: float, link: str = "", page: str = "") -> None:
        """The one clear screen; `link` signs a browser in once, `page` opens Foxglove on the fleet."""
        router = "hosted here" if plan.own_router else "joined"
        names = "  ".join(plan.robot_names) or "none"
        rows = (
            ("Dashboard", f"[bold cyan underline]{plan.url}[/]"),
            *([("Replicas", "  ".join(f"[cyan]{url}[/]" for url in plan.replica_urls))] if plan.replicas else []),
            *([("Sign in", f"[cyan]{link}[/]  [dim]once, within 15 min[/]")] if link else []),
            ("Robots", f"[bold]{names}[/]  [dim]all online[/]" if plan.robot_names else "[dim]none[/]"),
            ("Zenoh", f"tcp/127.0.0.1:{plan.zenoh_port}  [dim]router {router} · ROS domain {plan.domain}[/]"),
            ("Agents", f"{plan.link}  [dim]gRPC[/]"),
            *([("Foxglove", f"[cyan]{page}[/]  [dim]for an hour[/]")] if page else []),
            ("Data", _escape(str(plan.data_dir))),
            ("Logs", _escape(str(plan.log_dir))),
        )
        self._print(
            # in one piece: a script that waits for "Ready" finds the addresses with it
            "\n".join(
                (
                    f"\n  [bold green]Ready[/] [dim]in {took_s:.1f} s[/]\n",
                    *(f"  [dim]{label:<{WIDTH}}[/]{value}" for label, value in rows),
                    f"\n  [dim]{'Try':<{WIDTH}}[/]{_suggestion(plan)}",
                    f"  [dim]{'Stop':<{WIDTH}}[/][bold]Ctrl-C[/]\n",
                )
            )
        )

    def event(self, event: Event, *, ready: bool) -> None:
        """A process died, or is back: one line each."""
        stamp = f"[dim]{datetime.fromtimestamp(self._clock.wall_ns() / 1e9):%H:%M:%S}[/]"
        name, detail = f"[bold]{_escape(event.name)}[/]", _escape(event.detail)
        match event.kind:
            case EventKind.EXITED if ready:
                self._print(f"  [red]✗[/] {stamp}  {name} {detail}")
            case EventKind.STARTED if event.restarts:
                self._print(f"  [green]↻[/] {stamp}  {name} restarted [dim](pid {event.pid})[/]")
            case EventKind.QUARANTINED:
                self._print(f"  [red]✗[/] {stamp}  {name} keeps dying ({detail}): next try in {event.delay_s:.0f} s")
            case EventKind.ENDED if ready:
                self._print(f"  [red]✗[/] {stamp}  {name} is not started again: {detail}")
            case EventKind.KILLED:
                self._print(f"  [yellow]![/] {stamp}  {name} did not stop in time and was killed")

    def stopping(self) -> None:
        """Ctrl-C was seen."""
        self._end_status()
        if self._console.is_terminal:
            with contextlib.suppress(OSError):
                sys.stdout.write("\r\x1b[2K")  # the ^C that the terminal echoed
        self._print("  [dim]stopping …[/]")

    def stopped(self) -> None:
        """The last line."""
        self._print("  stopped")

    def _end_status(self) -> None:
        with self._lock:
            if self._status:
                self._status.stop()
                self._status = None

    def _print(self, text: str) -> None:
        with contextlib.suppress(OSError):  # the reader or the terminal may be gone; the robots must not care
            self._console.print(text)
            sys.stdout.flush()


def _suggestion(plan: Plan) -> str:
    """A command that shows something at once."""
    port = "" if plan.zenoh_port == DEFAULT_ZENOH_PORT else f" --zenoh-port {plan.zenoh_port}"
    topic = f"/{plan.simulated[0]}/odom" if plan.simulated else "/host/cpu" if plan.host_robot else ""
    return f"metaros topic echo {topic} --once{port}" if topic else f"metaros doctor{port}"


def _escape(text: str) -> str:
    from rich.markup import escape

    from metaros.sanitize import sanitize_lines

    return escape(sanitize_lines(text))
