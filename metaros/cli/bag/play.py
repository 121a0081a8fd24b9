"""`metaros bag play`: a recording as live topics."""

from __future__ import annotations

import sys
import threading
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from metaros.cli.shared.options import DEFAULT_ZENOH_PORT, Domain, Format, FormatOption, ZenohPort

if TYPE_CHECKING:
    from metaros.record import Player, PlayerReport

__all__ = ["play", "play_recording"]


def play(
    file: Annotated[Path, typer.Argument(metavar="BAG", help="An .mcap file, or a folder of them.")],
    topics: Annotated[
        list[str] | None, typer.Option("--topics", metavar="GLOB", help="Only these; may be repeated.")
    ] = None,
    rate: Annotated[
        float, typer.Option("--rate", "-r", min=0.0, metavar="FACTOR", help="1 original, 2 twice, 0 flat out.")
    ] = 1.0,
    start: Annotated[
        float, typer.Option("--start", "-s", min=0.0, metavar="SECONDS", help="Begin so far into the recording.")
    ] = 0.0,
    duration: Annotated[
        float, typer.Option("--duration", "-d", min=0.0, metavar="SECONDS", help="Play only so much; 0: to the end.")
    ] = 0.0,
    loop: Annotated[bool, typer.Option("--loop", "-l", help="Start again at the end.")] = False,
    remap: Annotated[
        list[str] | None, typer.Option("--remap", "-m", metavar="OLD:=NEW", help="Another name; may be repeated.")
    ] = None,
    clock: Annotated[
        float, typer.Option("--clock", min=0.0, metavar="HZ", help="Publish /clock so often; 0: not.")
    ] = 0.0,
    keep_stamps: Annotated[
        bool, typer.Option("--keep-stamps", help="The original source stamps beside the payloads, instead of now.")
    ] = False,
    wait: Annotated[
        float, typer.Option("--wait", min=0.0, metavar="SECONDS", help="For subscribers, before the first message.")
    ] = 1.0,
    paused: Annotated[bool, typer.Option("--start-paused", help="Wait for the space bar.")] = False,
    zenoh_port: ZenohPort = DEFAULT_ZENOH_PORT,
    domain: Domain = 0,
    output: FormatOption = Format.TEXT,
) -> None:
    """Play a recording: the original names, types, hashes, QoS and bytes. Space pauses."""
    from metaros.cli.shared import running
    from metaros.cli.shared.connection import connect
    from metaros.errors import UsageError
    from metaros.record import Player

    if paused and not sys.stdin.isatty():
        raise UsageError("--start-paused needs a terminal: nobody could press the space bar")
    with running.stop_on_signals() as stop, connect(zenoh_port, domain) as context:
        player = Player(
            context,
            file,
            rate=rate,
            start_s=start,
            duration_s=duration or None,
            topics=topics or (),
            remap=_renames(remap or []),
            loop=loop,
            clock_hz=clock,
            keep_stamps=keep_stamps,
        )
        with player:
            if paused:
                player.pause()
            play_recording(player, stop=stop, wait_s=wait, output=output)


def play_recording(player: Player, *, stop: threading.Event, wait_s: float, output: Format) -> None:
    """Play it with the space bar as pause, and say what was played."""
    from dataclasses import asdict

    from metaros.cli.shared.keys import keyboard
    from metaros.cli.shared.output import Output

    out = Output(output)
    tell = sys.stderr.isatty() and not out.json
    with keyboard() as key:
        ended = threading.Event()
        listener = threading.Thread(target=_listen, args=(player, key, ended), name="metaros-keys", daemon=True)
        listener.start()
        try:
            report = player.play(wait_subscriber_s=wait_s, stop=stop, on_progress=_progress if tell else None)
        finally:
            ended.set()
            listener.join()
    if out.json:
        out.object_line(asdict(report))
        return
    if tell:
        sys.stderr.write("\r\x1b[2K")
    out.line(f"{report.messages} messages on {len(player.topics)} topics, {report.log_s:.1f} s of the recording")


def _listen(player: Player, key: object, ended: threading.Event) -> None:
    """The space bar, on a thread of its own: the player waits for nobody."""
    while callable(key) and not ended.wait(0.05):
        if key() == " ":
            (player.resume if player.paused else player.pause)()


def _renames(texts: list[str]) -> dict[str, str]:
    from metaros.errors import UsageError

    renames = {}
    for text in texts:
        old, arrow, new = text.partition(":=")
        if not (old and arrow and new):
            raise UsageError(f"--remap {text!r} is not OLD:=NEW")
        renames[old] = new
    return renames


def _progress(report: PlayerReport) -> None:
    """One line, written over itself."""
    width = 30
    filled = round(width * min(1.0, report.log_s / report.total_s)) if report.total_s else width
    bar = f"\x1b[36m{'━' * filled}\x1b[0m\x1b[2m{'━' * (width - filled)}\x1b[0m"
    state = "   \x1b[33mpaused\x1b[0m" if report.paused else ""
    again = f"   round {report.loop}" if report.loop > 1 else ""
    sys.stderr.write(
        f"\r\x1b[2K{bar} {report.log_s:6.1f} / {report.total_s:.1f} s   {report.messages} messages{again}{state}\r"
    )
    sys.stderr.flush()
