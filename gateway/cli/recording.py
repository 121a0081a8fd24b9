"""`metaros recording`: the last minutes of a robot, saved in full and fetched as a file."""

from __future__ import annotations

import re
import sys
import threading
from collections.abc import Callable, Sequence
from datetime import datetime
from pathlib import Path
from typing import Annotated, Any

import typer

from gateway.domain.robot import is_robot_id
from gateway.errors import GatewayError
from metaros.cli.shared.gateway_http import GatewayClient, GatewayOption, open_gateway, path_part
from metaros.cli.shared.options import Format, FormatOption
from metaros.cli.shared.output import Output, human_bytes
from metaros.cli.shared.watch import WatchOption, watch
from metaros.errors import ConfigError, PeerError, UsageError
from metaros.sanitize import sanitize

__all__ = ["register"]

LOOK_S = 0.3
UNFINISHED = ("requested", "cutting", "transferring")
_SPAN = re.compile(r"(\d{1,9}(?:\.\d{1,6})?)(ms|s|m|h)?")
_TIME = re.compile(r"[0-9]{4}-[0-9]{2}-[0-9]{2}T[0-9]{2}:[0-9]{2}:[0-9]{2}")
_SHA256 = re.compile(r"[0-9a-f]{64}")
_UNIT_S = {"ms": 0.001, "s": 1.0, "m": 60.0, "h": 3600.0, None: 1.0}

Id = Annotated[str, typer.Argument(metavar="ID", help="The recording, as `metaros recording list` shows it.")]
File = Annotated[
    Path | None,
    typer.Option("--file", "-f", metavar="FILE", help="Where to write it; default: the robot's name and the time."),
]
Last = Annotated[str, typer.Option("--last", "-l", metavar="SPAN", help="How far back from now: 60s, 5m.")]
Start = Annotated[str, typer.Option("--start", "-s", metavar="TIME", help="RFC 3339 by the robot's clock, or -10m.")]
End = Annotated[str, typer.Option("--end", "-e", metavar="TIME", help="RFC 3339, relative, or now.")]
Topics = Annotated[list[str] | None, typer.Option("--topics", metavar="GLOB", help="Only these; may be repeated.")]


def register(app: typer.Typer) -> None:
    """Add the noun to `metaros`."""
    noun = typer.Typer(no_args_is_help=True, help="The last minutes of a robot, in full: its black box.")
    for name, command in (("list", _list), ("save", _save), ("get", _get), ("delete", _delete)):
        noun.command(name)(command)
    app.add_typer(noun, name="recording")


def _list(
    robot: Annotated[str | None, typer.Argument(metavar="[ROBOT]", help="Only this robot's.")] = None,
    limit: Annotated[int, typer.Option("--limit", "-n", min=1, max=1000, metavar="COUNT", help="The newest.")] = 50,
    again: WatchOption = False,
    gateway: GatewayOption = "",
    output: FormatOption = Format.TEXT,
) -> None:
    """The recordings of a gateway, the newest first."""
    out, http = Output(output), open_gateway(gateway)
    names = ("Id", "Robot", "State", "From (UTC)", "Span", "Messages", "Size")

    def show(found: Any) -> None:
        out.listing(names, found, _row, empty="no recordings", right=(4, 5, 6))

    watch(out, lambda: http.get("/api/v1/recordings", robot=robot, limit=limit)["recordings"], show, again=again)


def _save(
    robot: Annotated[str, typer.Argument(metavar="ROBOT", help="The robot's id; it may be offline.")],
    last: Last = "",
    start: Start = "",
    end: End = "now",
    topics: Topics = None,
    wait: Annotated[bool, typer.Option("--wait/--no-wait", help="Follow it until the gateway has it.")] = True,
    gateway: GatewayOption = "",
    output: FormatOption = Format.TEXT,
) -> None:
    """Save a span of a robot's black box, by default the last 60 s. Ctrl-C stops following, not the recording."""
    out, client = Output(output), open_gateway(gateway)
    if start and last:
        raise UsageError("say either --last, or --start and --end")
    span: dict[str, Any] = {"start": start, "end": end} if start else {"last_s": _seconds(last or "60s")}
    body = {**span, "topics": topics or []}
    saved = client.post(f"/api/v1/robots/{path_part(robot)}/recordings", body)
    if wait:
        out.note(sanitize(f"recording {saved['id']} of {robot}"))
        saved = _follow(client, saved, out)
    if out.json:
        out.objects(saved)
    else:
        out.line(sanitize(saved["id"]))
    if saved["state"] == "failed":
        raise GatewayError(f"the recording failed: {saved['message'] or saved['code']}")


def _get(
    recording_id: Id,
    file: File = None,
    gateway: GatewayOption = "",
) -> None:
    """Fetch a recording's MCAP file. A download that broke goes on where it was."""
    out, client = Output(), open_gateway(gateway)
    item = client.get(f"/api/v1/recordings/{path_part(recording_id)}")
    if item["state"] in UNFINISHED:
        item = _follow(client, item, out)
    if item["state"] != "stored":
        raise GatewayError(f"the recording failed: {item['message'] or item['code']}")
    path = file if file is not None else Path(_file_name(item))
    if not path.name or path.is_dir():
        raise ConfigError(f"{path} is a folder: name a file")
    path = path.with_name(path.name.replace(":", "-"))
    partial = path.with_name(f"{path.name}.{_sha256(item)[:8]}.partial")
    try:
        _download(client, item, partial, out)
        partial.replace(path)
    except OSError as error:
        raise ConfigError(f"cannot write {path}: {error.strerror or error}") from error
    out.line(str(path))


def _file_name(item: dict[str, Any]) -> str:
    """The robot's name and the time. A gateway says both, and shall not say where on this disk we write."""
    robot, at = str(item["robot"]), str(item["first"] or item["start"])[:19]
    if not is_robot_id(robot) or not _TIME.fullmatch(at):
        raise PeerError(f"what answers is no gateway: a recording of {robot[:80]!r} at {at!r}")
    return f"{robot}_{at}Z.mcap"


def _sha256(item: dict[str, Any]) -> str:
    digest = str(item["sha256"])
    if not _SHA256.fullmatch(digest):
        raise PeerError(f"what answers is no gateway: a checksum of {digest[:80]!r}")
    return digest


def _delete(recording_id: Id, gateway: GatewayOption = "") -> None:
    """Delete a recording and its file; one that is on its way is given up."""
    open_gateway(gateway).delete(f"/api/v1/recordings/{path_part(recording_id)}")


def _follow(client: GatewayClient, item: dict[str, Any], out: Output) -> dict[str, Any]:
    """The recording at its end; each change is shown."""
    shown, pause = "", threading.Event()
    while item["state"] in UNFINISHED:
        text = _progress(item)
        if text != shown and (out.tty or _stage(text) != _stage(shown)):
            out.note(sanitize(text))
        shown = text
        pause.wait(LOOK_S)
        item = client.get(f"/api/v1/recordings/{path_part(item['id'])}")
    return item


def _download(client: GatewayClient, item: dict[str, Any], partial: Path, out: Output) -> None:
    """Append what is missing of the file, and check it as a whole."""
    import hashlib

    have = partial.stat().st_size if partial.exists() else 0
    total = int(item["size_bytes"])
    if have < total:
        headers = {"Range": f"bytes={have}-"} if have else {}
        with client.open("GET", item["url"], headers=headers) as answer:
            with partial.open("ab" if answer.status == 206 else "wb") as target:
                for piece in answer.pieces():
                    if target.tell() + len(piece) > total:
                        raise PeerError(f"what came is not the recording: it is larger than {human_bytes(total)}")
                    target.write(piece)
                    _meter(target.tell(), total, out)
    digest = hashlib.sha256()
    with partial.open("rb") as source:
        while piece := source.read(1 << 20):
            digest.update(piece)
    if digest.hexdigest() != item["sha256"]:
        partial.unlink()
        raise PeerError("what came is not the recording: its checksum is wrong\ntry again")


def _meter(done: int, total: int, out: Output) -> None:
    """How far a download is, on a terminal."""
    if out.tty and sys.stderr.isatty():
        end = "\n" if done >= total else ""
        sys.stderr.write(f"\r{human_bytes(done)} of {human_bytes(total)}   {end}")
        sys.stderr.flush()


def _row(item: dict[str, Any]) -> Sequence[object]:
    state = item["state"]
    if state == "failed":
        state = f"failed: {item['code']}"
    elif state == "transferring" and item["size_bytes"]:
        state = f"transferring {100 * item['received_bytes'] // item['size_bytes']} %"
    size = human_bytes(item["size_bytes"]) if item["size_bytes"] else ""
    start, end = (
        datetime.fromisoformat(item[had] or item[asked]) for had, asked in (("first", "start"), ("last", "end"))
    )
    span = f"{(end - start).total_seconds():.0f} s"
    return item["id"], item["robot"], state, f"{start:%m-%d %H:%M:%S}", span, item["messages"] or "", size


def _progress(item: dict[str, Any]) -> str:
    words: dict[str, Callable[[], str]] = {
        "requested": lambda: "requested: waits for the robot",
        "cutting": lambda: "cutting: the robot writes the file",
        "transferring": lambda: (
            f"transferring: {human_bytes(item['received_bytes'])} of {human_bytes(item['size_bytes'])}"
        ),
    }
    why = f" ({item['message']})" if item["message"] else ""
    return words[item["state"]]() + why


def _stage(text: str) -> str:
    return text.partition(":")[0]


def _seconds(text: str) -> float:
    """A span like 60s; UsageError says what is understood."""
    match = _SPAN.fullmatch(text.lstrip("-"))
    if match is None or not float(match[1]):
        raise UsageError(f"--last {text}: not a span like 60s, 5m or 1h")
    return float(match[1]) * _UNIT_S[match[2]]
