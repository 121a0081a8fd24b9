"""`metaros bag record` and `save`: topics into MCAP files, or into a ring that is written on request."""

from __future__ import annotations

import signal
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from metaros.cli.shared.options import DEFAULT_ZENOH_PORT, Domain, Format, FormatOption, StatusFile, ZenohPort
from metaros.limits import LIMITS

if TYPE_CHECKING:
    import threading

    from metaros.cli.shared.output import Output
    from metaros.clock import Clock
    from metaros.record import Recorder, RecordingReport

__all__ = ["record", "save"]

_TOLD_S = 0.5
_NAME = "metaros_recorder"


Topics = Annotated[list[str] | None, typer.Argument(metavar="TOPIC", help="Names and globs, such as '/sim_1/**'.")]
All = Annotated[bool, typer.Option("--all", "-a", help="Every topic that is not hidden.")]
Exclude = Annotated[
    list[str] | None, typer.Option("--exclude", "-x", metavar="GLOB", help="But not these; may be repeated.")
]
Hidden = Annotated[bool, typer.Option("--include-hidden-topics", help="Those of actions, too.")]
Target = Annotated[
    str, typer.Option("--target", "-t", metavar="PATH", show_default=False, help="A new folder, or one FILE.mcap.")
]
Compression = Annotated[str, typer.Option("--compression", metavar="zstd|lz4|none", help="Of the file's chunks.")]
SplitMb = Annotated[float, typer.Option("--split-mb", min=0.0, metavar="MB", help="A new file at this size; 0: never.")]
SplitS = Annotated[
    float, typer.Option("--split-s", min=0.0, metavar="SECONDS", help="A new file after so long; 0: never.")
]
RingS = Annotated[
    float,
    typer.Option("--ring", min=0.0, metavar="SECONDS", help="Only the last SECONDS, in memory until `save`; 0: off."),
]
RingMb = Annotated[float, typer.Option("--ring-mb", min=1.0, metavar="MB", help="Bound of the ring.")]
QueueMb = Annotated[float, typer.Option("--queue-mb", min=0.1, metavar="MB", help="Bound of what waits for the disk.")]
Duration = Annotated[
    float, typer.Option("--duration", "-d", min=0.0, metavar="SECONDS", help="Stop after so long; 0: at Ctrl-C.")
]
Paused = Annotated[bool, typer.Option("--start-paused", help="Record nothing before ~/resume or the space bar.")]
Name = Annotated[str, typer.Option("--name", metavar="NODE", help="The recorder's node.")]


def record(
    topics: Topics = None,
    all_: All = False,
    exclude: Exclude = None,
    hidden: Hidden = False,
    target: Target = "",
    compression: Compression = "zstd",
    split_mb: SplitMb = 0.0,
    split_s: SplitS = 0.0,
    ring_s: RingS = 0.0,
    ring_mb: RingMb = LIMITS.recorder_ring_bytes // 10**6,
    queue_mb: QueueMb = LIMITS.recorder_queue_bytes // 10**6,
    duration: Duration = 0.0,
    paused: Paused = False,
    name: Name = _NAME,
    zenoh_port: ZenohPort = DEFAULT_ZENOH_PORT,
    domain: Domain = 0,
    status_file: StatusFile = "",
    output: FormatOption = Format.TEXT,
) -> None:
    """Record topics until Ctrl-C, with types, QoS and every gap; new topics join as they appear."""
    from metaros.cli.shared.output import Output
    from metaros.clock import SystemClock
    from metaros.errors import UsageError
    from metaros.record import BagOptions, RingOptions

    if not topics and not all_:
        raise UsageError("what is to be recorded?\nname topics or globs, or --all")
    path = Path(target) if target else _default_path(SystemClock())
    settings = {
        "topics": [*(topics or ()), *(["**"] if all_ else ())],
        "exclude": exclude or (),
        "hidden": hidden,
        "options": BagOptions(compression=compression, split_bytes=round(split_mb * 1e6), split_s=split_s),
        "ring": RingOptions(window_s=ring_s, limit_bytes=round(ring_mb * 1e6)) if ring_s else None,
        "queue_bytes": round(queue_mb * 1e6),
        "paused": paused,
        "name": name,
    }
    _run(path, Output(output), settings, duration, (zenoh_port, domain), status_file)


def _run(
    path: Path, out: Output, settings: dict[str, Any], duration_s: float, where: tuple[int, int], status_file: str
) -> None:
    """From the first sample to the last line."""
    from metaros.cli.shared import running
    from metaros.cli.shared.connection import connect
    from metaros.clock import SystemClock
    from metaros.record import Recorder

    with running.stop_on_signals() as stop, _save_signal() as asked, connect(*where, spin_time=0.5) as context:
        recorder = Recorder(context, path, notice=lambda text: _over(out, text), **settings)
        try:
            running.write_status(running.status_file(status_file), node=recorder.node_name, recording=str(path))
            ring = settings["ring"]
            what = (
                f"the last {ring.window_s:g} s, in memory: `metaros bag save` writes them" if ring else "Ctrl-C stops"
            )
            out.note(f"recording into {path}  ({what})")
            _watch(recorder, out, SystemClock(), duration_s, stop, asked)
        finally:
            report = recorder.close()
    _conclude(out, path, report)


def save(
    name: Name = _NAME,
    zenoh_port: ZenohPort = DEFAULT_ZENOH_PORT,
    domain: Domain = 0,
    output: FormatOption = Format.TEXT,
) -> None:
    """Have a running recorder write its ring to a file, and say which."""
    from metaros.cli.shared.connection import absolute, connect
    from metaros.cli.shared.output import Output
    from metaros.errors import RecordingError, UnavailableError
    from metaros.interfaces.std_srvs.srv import Trigger
    from metaros.node import Node

    out, service = Output(output), f"{absolute(name)}/save"
    with connect(zenoh_port, domain, spin_time=2.0) as context:
        with Node("metaros_cli", context=context, enable_rosout=False, enable_parameters=False) as node:
            with node.create_client(Trigger, service) as client:
                if not client.service_is_ready():
                    raise UnavailableError(
                        f"no recorder named {absolute(name)}\nstart one: metaros bag record --ring 30 --all"
                    )
                answer = client.call(Trigger.Request(), timeout_s=90.0)
    if not answer.success:
        raise RecordingError(answer.message)
    if out.json:
        out.object_line({"path": answer.message})
    else:
        out.line(answer.message)


def _default_path(clock: Clock) -> Path:
    """A folder named by the date, as rosbag2 does."""
    from datetime import datetime

    stamp = datetime.fromtimestamp(clock.wall_ns() // 10**9)
    return Path(stamp.strftime("metaros_%Y_%m_%d-%H_%M_%S"))


@contextmanager
def _save_signal() -> Iterator[threading.Event]:
    """An event that SIGUSR1 sets, where the platform has it."""
    import threading

    asked = threading.Event()
    number = getattr(signal, "SIGUSR1", None)
    if number is None:
        yield asked
        return
    before = signal.signal(number, lambda *_: asked.set())
    try:
        yield asked
    finally:
        signal.signal(number, before)


def _watch(
    recorder: Recorder, out: Output, clock: Clock, duration_s: float, stop: threading.Event, asked: threading.Event
) -> None:
    """Until Ctrl-C, the duration, or a failure: save when asked, pause on the space bar, tell how it goes."""
    from metaros.cli.shared.keys import keyboard
    from metaros.errors import MetarosError

    begin_s = clock.monotonic_s()
    with keyboard() as key:
        while not stop.wait(_TOLD_S if not key else 0.1) and not recorder.ended.is_set():
            elapsed_s = clock.monotonic_s() - begin_s
            if duration_s and elapsed_s >= duration_s:
                return
            if asked.is_set():
                asked.clear()
                try:
                    _over(out, f"saved {recorder.save()}")
                except MetarosError as error:
                    _over(out, f"not saved: {error}")
            if key and key() == " ":
                (recorder.resume if recorder.paused else recorder.pause)()
            if sys.stderr.isatty() and not out.json:
                _progress(recorder.report(), elapsed_s)


def _progress(report: RecordingReport, elapsed_s: float) -> None:
    """One line, written over itself."""
    from metaros.cli.shared.output import human_bytes

    state = "\x1b[33mpaused\x1b[0m   " if report.paused else ""
    ring = f"   ring {report.ring_s:.0f} s" if report.ring_s else ""
    bad = f"   \x1b[31m{report.dropped} dropped\x1b[0m" if report.dropped else ""
    waiting = f"   {human_bytes(report.waiting_bytes)} waiting" if report.waiting_bytes > 10_000_000 else ""
    sys.stderr.write(
        f"{_clear()}{elapsed_s:7.1f} s   {state}{report.topics} topics   {report.received} messages"
        f"   {human_bytes(report.size_bytes)}{ring}{waiting}{bad}\r"
    )
    sys.stderr.flush()


def _over(out: Output, text: str) -> None:
    """A remark in the place of the progress line."""
    sys.stderr.write(_clear())
    out.note(text)


def _clear() -> str:
    return "\r\x1b[2K" if sys.stderr.isatty() else ""


def _conclude(out: Output, path: Path, report: RecordingReport) -> None:
    """What there is now, and what is missing."""
    from metaros.cli.bag.view import missing_text
    from metaros.cli.shared.output import human_bytes

    if out.json:
        facts: dict[str, Any] = {
            "path": str(path),
            "files": [str(file) for file in report.files],
            "messages": report.written,
            "topics": report.topics,
            "size_bytes": report.size_bytes,
            "missing": report.missing,
            "malformed": report.malformed,
        }
        out.object_line(facts)
        return
    if sys.stderr.isatty():
        sys.stderr.write(_clear())
    files = f", {len(report.files)} files" if len(report.files) > 1 else ""
    out.line(f"{path}: {report.written} messages of {report.topics} topics, {human_bytes(report.size_bytes)}{files}")
    if missing := missing_text(report.missing):
        out.line(f"missing: {missing}; `metaros bag info` tells which")
    if report.malformed:
        out.line(f"{report.malformed} samples without a sound attachment were passed over")
