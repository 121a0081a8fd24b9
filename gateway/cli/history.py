"""`metaros history`: what a gateway has stored, on the command line."""

from __future__ import annotations

import json
import sys
from collections.abc import Iterator
from enum import StrEnum
from pathlib import Path
from typing import Annotated, Any

import typer

from metaros.cli.shared.gateway_http import Answer, GatewayClient, GatewayOption, open_gateway, path_part
from metaros.cli.shared.options import Format, FormatOption
from metaros.sanitize import sanitize

__all__ = ["register"]

MAGIC = b"\x89MCAP0\r\n"  # first and last in every MCAP file
PAGE = 1000
SHOWN_BYTES = 1 << 20  # how often the progress of an export is shown


class Order(StrEnum):
    """Of messages, by their stamps."""

    ASC = "asc"
    DESC = "desc"


Robot = Annotated[str, typer.Argument(metavar="ROBOT", help="The robot's id.")]
Topics = Annotated[
    list[str] | None,
    typer.Option("--topics", metavar="GLOB", help="Only these, relative to the robot's namespace; may be repeated."),
]
Start = Annotated[str, typer.Option("--start", "-s", metavar="TIME", help="RFC 3339, or relative like -15m.")]
End = Annotated[str, typer.Option("--end", "-e", metavar="TIME", help="RFC 3339, relative, or now.")]


def register(app: typer.Typer) -> None:
    """Add the noun to `metaros`."""
    history = typer.Typer(no_args_is_help=True, help="What a gateway has stored: topics, messages, MCAP files.")
    for name, command in (("topics", _topics), ("messages", _messages), ("export", _export)):
        history.command(name)(command)
    app.add_typer(history, name="history")


def _topics(robot: Robot, gateway: GatewayOption = "", output: FormatOption = Format.TEXT) -> None:
    """Which topics of a robot are stored, and how much of them."""
    from metaros.cli.shared.output import Output, human_bytes

    out = Output(output)
    answer = open_gateway(gateway).get(f"/api/v1/robots/{path_part(robot)}/history")
    if out.json:
        out.objects(answer)
        return
    rows = [
        (
            row["topic"],
            row["type"],
            row["samples"],
            human_bytes(row["bytes"]),
            _short(row["first"]),
            _short(row["last"]),
        )
        for row in answer["topics"]
    ]
    names = ("Topic", "Type", "Messages", "Size", "First (UTC)", "Last (UTC)")
    out.table(names, rows, empty=f"no message of {robot} is stored", right=(2, 3))
    if answer["series"]:
        out.note(f"and {answer['series']} series of numbers, see /api/v1/robots/{robot}/metrics")


def _short(time: str) -> str:
    """2026-11-21T06:00:00.000Z as 11-21 06:00:00."""
    return time[5:19].replace("T", " ")


def _messages(
    robot: Robot,
    topics: Topics = None,
    start: Start = "-15m",
    end: End = "now",
    limit: Annotated[int, typer.Option("--limit", "-n", min=1, metavar="COUNT", help="No more than so many.")] = 100,
    order: Annotated[Order, typer.Option("--order", metavar="asc|desc", help="Oldest or newest first.")] = Order.ASC,
    gateway: GatewayOption = "",
    output: FormatOption = Format.TEXT,
) -> None:
    """Stored messages, decoded, a line each."""
    from metaros.cli.shared.output import Output

    out = Output(output)
    gaps: list[Any] = []
    query = {"topic": topics, "start": start, "end": end, "order": order.value}
    for message in _pages(open_gateway(gateway), robot, query, limit, gaps):
        if out.json:
            out.object_line(message)
            continue
        shown = message["message"] if "error" not in message else message["error"]
        out.line(sanitize(f"{message['stamp']}  {message['topic']}  {json.dumps(shown, ensure_ascii=False)}"))
    lost = sum(gap["count"] for gap in gaps)
    if lost:
        reasons = ", ".join(sorted({gap["reason"] for gap in gaps}))
        out.note(sanitize(f"{lost} samples of that time are lost: {reasons}"))


def _pages(
    client: GatewayClient, robot: str, query: dict[str, Any], limit: int, gaps: list[Any]
) -> Iterator[dict[str, Any]]:
    """Messages of as many pages as it takes; the losses of the range come with the first one."""
    path, cursor = f"/api/v1/robots/{path_part(robot)}/messages", None
    while limit > 0:
        page = client.get(path, **query, limit=min(limit, PAGE), cursor=cursor)
        if cursor is None:
            gaps += page["gaps"]
        yield from page["messages"]
        limit -= len(page["messages"])
        cursor = page["next"]
        if cursor is None:
            return


def _export(
    file: Annotated[Path, typer.Argument(metavar="FILE.mcap", help="A new file.")],
    robots: Annotated[list[str], typer.Option("--robot", "-r", metavar="ID", help="Whose messages; may be repeated.")],
    topics: Topics = None,
    start: Start = "-15m",
    end: End = "now",
    gateway: GatewayOption = "",
) -> None:
    """Write stored messages of some robots to an MCAP file."""
    from metaros.cli.shared.output import Output, human_bytes
    from metaros.errors import ConfigError

    out = Output()
    if file.exists():
        raise ConfigError(f"{file} is there already, and is not overwritten")
    partial = file.with_name(file.name + ".partial")
    query = {"robot": robots, "topic": topics, "start": start, "end": end}
    try:
        with open_gateway(gateway).open("GET", "/api/v1/export.mcap", query=query) as answer:
            size_bytes = _save(answer, partial)
        partial.rename(file)
    except OSError as error:
        raise ConfigError(f"cannot write {file}: {error.strerror or error}") from error
    finally:
        partial.unlink(missing_ok=True)
    out.line(f"{file}: {human_bytes(size_bytes)}")


def _save(answer: Answer, path: Path) -> int:
    """The answer's body in a file; PeerError unless it is a whole MCAP file."""
    from metaros.cli.shared.output import human_bytes
    from metaros.errors import PeerError

    size_bytes, reported_bytes, end = 0, 0, b""
    with path.open("wb") as output:
        for piece in answer.pieces():
            output.write(piece)
            size_bytes += len(piece)
            end = (end + piece)[-len(MAGIC) :]
            if sys.stderr.isatty() and size_bytes - reported_bytes >= SHOWN_BYTES:
                reported_bytes = size_bytes
                sys.stderr.write(f"\r{human_bytes(size_bytes)}\x1b[K")
    if reported_bytes:
        sys.stderr.write("\r\x1b[K")
    if end != MAGIC:
        raise PeerError(f"the gateway ended the file early, after {human_bytes(size_bytes)}; nothing is kept of it")
    return size_bytes
