"""`metaros topic echo`, `hz`, `bw` and `delay`: listen to one topic and print as it comes."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING, Annotated, Any

import typer

from metaros.cli.graph_target.target import GraphTarget, graph_command

if TYPE_CHECKING:
    from metaros.cli.shared.output import Output

__all__ = ["bw", "delay", "echo", "hz"]

TopicArgument = Annotated[str, typer.Argument(metavar="TOPIC", help="Such as /sim_1/odom; from the root if relative.")]
Window = Annotated[int, typer.Option("--window", "-w", min=2, metavar="N", help="Over how many of the last messages.")]


@graph_command
def echo(
    target: GraphTarget,
    topic: TopicArgument,
    type_name: Annotated[
        str, typer.Argument(metavar="TYPE", help="Needed only while nobody is there, or of several types.")
    ] = "",
    once: Annotated[bool, typer.Option("--once", help="Stop after one message.")] = False,
    number: Annotated[
        int, typer.Option("-n", "--number", min=0, metavar="N", show_default=False, help="Stop after so many messages.")
    ] = 0,
    raw: Annotated[bool, typer.Option("--raw", help="The bytes in hexadecimal, undecoded.")] = False,
    field: Annotated[
        str, typer.Option("--field", metavar="PATH", help="Only this field, such as pose.pose.position.x.")
    ] = "",
    full: Annotated[bool, typer.Option("--full-length", "-f", help="Arrays in full.")] = False,
    timeout: Annotated[
        float,
        typer.Option(
            "--timeout", min=0.0, metavar="SECONDS", show_default=False, help="Give up when silent for so many seconds."
        ),
    ] = 0.0,
) -> None:
    """Print a topic's messages."""
    out = target.out
    wanted = 1 if once else number
    with target.listen(topic, type_name, raw=raw) as listener:
        show = _shower(listener, out, raw=raw, field=field, full=full)
        for count, payload in enumerate(listener.payloads(timeout_s=timeout), start=1):
            show(payload)
            if count == wanted:
                return


def _shower(listener: Any, out: Output, *, raw: bool, field: str, full: bool) -> Callable[[bytes], None]:
    """How one payload is printed."""
    from metaros.cdr import codec
    from metaros.cli.shared.render import field_of, message_yaml, plain

    if raw:
        return lambda payload: out.object_line({"cdr": payload.hex()}) if out.json else out.line(payload.hex())
    decode = codec(listener.found.type_name, listener.found.catalogue).decode

    def show(payload: bytes) -> None:
        message = decode(payload)
        value = field_of(message, field) if field else message
        if out.json:
            out.object_line(plain(value))
        elif hasattr(type(value), "__metaros_name__"):
            out.line(f"{message_yaml(value, full=full)}\n---")
        else:
            out.line(f"{_text(plain(value))}\n---")

    return show


def _json(value: Any) -> str:
    import json

    return json.dumps(value, ensure_ascii=False)


def _text(value: Any) -> str:
    return value if isinstance(value, str) else _json(value)


@graph_command
def hz(
    target: GraphTarget,
    topic: TopicArgument,
    window: Window = 10_000,
    number: Annotated[
        int, typer.Option("-n", "--number", min=0, metavar="N", show_default=False, help="Stop after so many reports.")
    ] = 0,
) -> None:
    """Measure how often a topic is published, once a second."""
    from metaros.cli.graph_target.listener import Rate

    out = target.out
    with target.listen(topic, raw=True) as listener:
        rate = Rate(window)
        for count, report in enumerate(listener.reports(rate), start=1):
            if out.json:
                out.object_line(report)
            elif report["window"] < 2:
                out.note("no new messages")
            else:
                gaps = "   ".join(f"{key}: {report[f'{key}_s']:.4f} s" for key in ("min", "max", "std"))
                out.line(f"average rate: {report['rate_hz']:.3f}   {gaps}   window: {report['window']}")
            if count == number:
                return


@graph_command
def bw(
    target: GraphTarget,
    topic: TopicArgument,
    window: Window = 100,
    number: Annotated[
        int, typer.Option("-n", "--number", min=0, metavar="N", show_default=False, help="Stop after so many reports.")
    ] = 0,
) -> None:
    """Measure how many bytes a topic takes, once a second."""
    from metaros.cli.graph_target.listener import Rate
    from metaros.cli.shared.output import human_bytes

    out = target.out
    with target.listen(topic, raw=True) as listener:
        rate = Rate(window)
        for count, report in enumerate(listener.reports(rate), start=1):
            if out.json:
                out.object_line(report)
            elif report["window"] < 2:
                out.note("no new messages")
            else:
                sizes = [human_bytes(report[key]) for key in ("bytes_per_s", "mean_bytes", "min_bytes", "max_bytes")]
                out.line(
                    f"{sizes[0]}/s from {report['window']} messages"
                    f"   mean: {sizes[1]}   min: {sizes[2]}   max: {sizes[3]}"
                )
            if count == number:
                return


@graph_command
def delay(
    target: GraphTarget,
    topic: TopicArgument,
    window: Window = 10_000,
    number: Annotated[
        int, typer.Option("-n", "--number", min=0, metavar="N", show_default=False, help="Stop after so many reports.")
    ] = 0,
) -> None:
    """Measure how old messages are when they arrive, by the stamp in their header, once a second."""
    from metaros.cli.topic.delay import Delay
    from metaros.clock import SystemClock

    out = target.out
    with target.listen(topic) as listener:
        found = listener.found
        meter = Delay(window, found.type_name, clock=SystemClock(), catalogue=found.catalogue)
        for count, report in enumerate(listener.reports(meter), start=1):
            if out.json:
                out.object_line(report)
            elif report["window"] < 2:
                out.note("no new messages")
            else:
                rest = "   ".join(f"{key}: {report[f'{key}_s']:.4f} s" for key in ("min", "max", "std"))
                out.line(f"average delay: {report['delay_s']:.4f} s   {rest}   window: {report['window']}")
            if count == number:
                return
