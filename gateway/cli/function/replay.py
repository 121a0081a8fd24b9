"""`metaros function replay`: what happened in a span is given to a function once more."""

from __future__ import annotations

import threading
from typing import Annotated, Any

import typer

from gateway.cli.function.json_input import given_json
from gateway.cli.function.view import FunctionName, function_path, moment
from metaros.cli.shared.gateway_http import GatewayClient, GatewayOption, open_gateway, path_part
from metaros.cli.shared.options import Format, FormatOption
from metaros.cli.shared.output import Output, counted, sanitize
from metaros.errors import PeerError

__all__ = ["register"]

EVERY_S = 0.5


def register(noun: typer.Typer) -> None:
    """Add the verbs to the noun."""
    noun.command("replay")(_replay)
    noun.command("replays")(_replays)


def _replay(
    name: FunctionName,
    start: Annotated[str, typer.Option("--from", metavar="TIME", help="RFC 3339, or relative: -2h.")],
    until: Annotated[str, typer.Option("--until", metavar="TIME", help="RFC 3339, relative, or now.")] = "now",
    pattern: Annotated[
        str, typer.Option("--pattern", metavar="JSON|@FILE|-", help="Only what fits: a pattern as rules have it.")
    ] = "",
    kind: Annotated[
        list[str] | None, typer.Option("--type", metavar="TYPE", help="Only these; may be repeated.")
    ] = None,
    qualifier: Annotated[str, typer.Option("--qualifier", metavar="VERSION", help="A version or an alias.")] = "",
    wait: Annotated[bool, typer.Option("--wait", help="Until all of it is in the queue.")] = False,
    gateway: GatewayOption = "",
    output: FormatOption = Format.TEXT,
) -> None:
    """Give a function what happened in a span once more, each happening once."""
    out, http = Output(output), open_gateway(gateway)
    asked: dict[str, Any] = {"from": start, "until": until, "types": kind or [], "qualifier": qualifier}
    if pattern:
        asked["pattern"] = given_json(pattern, "--pattern")
    done = http.post(function_path(name, "/replay"), asked)
    if wait:
        done = _ended(http, done)
    if out.json:
        out.objects(done)
    else:
        out.line(_line(done))
    if done["state"] == "failed":
        raise PeerError(f"the replay ended early: {done['message']}")


def _ended(http: GatewayClient, replay: Any) -> Any:
    while replay["state"] == "running":
        threading.Event().wait(EVERY_S)
        replay = http.get(f"/api/v1/replays/{path_part(replay['id'])}")
    return replay


def _replays(
    stop: Annotated[str, typer.Option("--stop", metavar="ID", help="End this one; what it put is delivered.")] = "",
    gateway: GatewayOption = "",
    output: FormatOption = Format.TEXT,
) -> None:
    """Replays under way, and the newest that ended."""
    out, http = Output(output), open_gateway(gateway)
    if stop:
        done = http.delete(f"/api/v1/replays/{path_part(stop)}")
        if out.json:
            out.objects(done)
        else:
            out.line(_line(done))
        return
    out.listing(
        ("Replay", "Function", "State", "From (UTC)", "Until (UTC)", "Looked at", "Given"),
        http.get("/api/v1/replays")["replays"],
        lambda one: (
            *(one["id"], one["function"], one["state"], moment(one["start"]), moment(one["until"])),
            *(one["seen"], one["put"]),
        ),
        empty="nothing was replayed",
        right=(5, 6),
    )


def _line(replay: Any) -> str:
    return sanitize(f"{replay['id']}: {replay['state']}, {counted(replay['put'], 'event')} of {replay['seen']}")
