"""`metaros play`: replay a real robot's log, or a recording, as live topics."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from metaros.cli.shared.options import DEFAULT_ZENOH_PORT, Domain, Format, FormatOption, ZenohPort

if TYPE_CHECKING:
    from metaros.record import PlayReport

__all__ = ["register"]


def register(app: typer.Typer) -> None:
    """Add the noun."""
    app.command("play")(play)


def play(
    file: Annotated[Path, typer.Argument(metavar="FILE", help="A CARMEN log (.clf, .log, bz2, gz), or a BAG.")],
    name: Annotated[
        str, typer.Option("--name", metavar="ROBOT", help="The robot: topics are /<name>/scan, /<name>/odom …")
    ] = "robot",
    rate: Annotated[
        float, typer.Option("--rate", "-r", min=0.0, metavar="FACTOR", help="1 original, 20 twenty-fold, 0 flat out.")
    ] = 1.0,
    limit: Annotated[
        float,
        typer.Option("--limit", min=0.0, metavar="SECONDS", show_default=False, help="Only this much of the log."),
    ] = 0.0,
    loop: Annotated[bool, typer.Option("--loop", "-l", help="Start again at the end.")] = False,
    wait: Annotated[
        float, typer.Option("--wait", min=0.0, metavar="SECONDS", help="For a subscriber, before the first message.")
    ] = 5.0,
    zenoh_port: ZenohPort = DEFAULT_ZENOH_PORT,
    domain: Domain = 0,
    output: FormatOption = Format.TEXT,
) -> None:
    """Replay a real robot's log as LaserScan, Odometry and tf; a recording (.mcap) as `metaros bag play` does."""
    from dataclasses import asdict

    from metaros.cli.shared import running
    from metaros.cli.shared.connection import connect
    from metaros.cli.shared.output import Output
    from metaros.record import play_carmen

    if file.suffix == ".mcap" or file.is_dir():
        _play_bag(file, rate, limit, loop, wait, zenoh_port, domain, output)
        return
    out = Output(output)
    with running.stop_on_signals() as stop, connect(zenoh_port, domain) as context:
        report = play_carmen(
            file,
            name=name,
            context=context,
            rate=rate,
            limit_s=limit or None,
            loop=loop,
            wait_subscriber_s=wait,
            on_progress=_progress if sys.stderr.isatty() and not out.json else None,
            stop=stop,
        )
    if out.json:
        out.object_line(asdict(report))
        return
    bad = f", {report.malformed} malformed lines skipped" if report.malformed else ""
    out.line(f"{report.scans} scans and {report.odometry} odometry messages, {report.log_s:.1f} s of log{bad}")


def _play_bag(
    file: Path, rate: float, limit: float, loop: bool, wait: float, zenoh_port: int, domain: int, output: Format
) -> None:
    from metaros.cli.bag.play import play_recording
    from metaros.cli.shared import running
    from metaros.cli.shared.connection import connect
    from metaros.record import Player

    with running.stop_on_signals() as stop, connect(zenoh_port, domain) as context:
        with Player(context, file, rate=rate, duration_s=limit or None, loop=loop) as player:
            play_recording(player, stop=stop, wait_s=wait, output=output)


def _progress(report: PlayReport) -> None:
    """One line, written over itself."""
    sys.stderr.write(f"\r\x1b[2K{report.log_s:8.1f} s of log   {report.scans} scans   {report.odometry} odometry\r")
    sys.stderr.flush()
