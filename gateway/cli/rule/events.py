"""`metaros rule events` and `put-event`: what happened, and something of one's own that did."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from typing import Annotated, Any

import typer

from gateway.cli.function.json_input import given_json
from gateway.cli.function.view import moment
from metaros.cli.shared.gateway_http import GatewayOption, open_gateway
from metaros.cli.shared.options import Format, FormatOption
from metaros.cli.shared.output import Output, sanitize

__all__ = ["register"]

PAGE = 200
WIDE = 90


def register(noun: typer.Typer) -> None:
    """Add the verbs to the noun."""
    noun.command("put-event")(_put_event)
    noun.command("events")(_events)


def _put_event(
    kind: Annotated[str, typer.Argument(metavar="TYPE", help="Of your own, as order.ready.")],
    detail: Annotated[str, typer.Option("--detail", metavar="JSON|@FILE|-", help="What there is to tell.")] = "",
    robot: Annotated[str, typer.Option("--robot", "-r", metavar="ROBOT", help="Whom it is about.")] = "",
    source: Annotated[str, typer.Option("--source", metavar="SOURCE", help="Whose events these are.")] = "user",
    ident: Annotated[str, typer.Option("--id", metavar="ID", help="Your own: the same twice is one event.")] = "",
    time: Annotated[str, typer.Option("--time", metavar="TIME", help="When; RFC 3339. Default: now.")] = "",
    gateway: GatewayOption = "",
    output: FormatOption = Format.TEXT,
) -> None:
    """Say that something happened: it is stored, and the rules judge it."""
    out = Output(output)
    said = {"type": kind, "source": source, "robot": robot, "id": ident, "time": time}
    entry = {**said, "detail": given_json(detail, "--detail") if detail else {}}
    done = open_gateway(gateway).post("/api/v1/happenings", {"entries": [entry]})
    if out.json:
        out.objects(done)
        return
    out.line(sanitize(done["ids"][0]))
    if done["duplicates"]:
        out.note("it was known already, and sets nothing off again")


def _events(
    kind: Annotated[list[str] | None, typer.Option("--type", metavar="TYPE", help="May be repeated.")] = None,
    robot: Annotated[str, typer.Option("--robot", "-r", metavar="ROBOT", help="Only about this robot.")] = "",
    source: Annotated[str, typer.Option("--source", metavar="SOURCE", help="Only from there.")] = "",
    start: Annotated[str, typer.Option("--start", "-s", metavar="TIME", help="RFC 3339, or relative: -2h.")] = "-1h",
    end: Annotated[str, typer.Option("--end", "-e", metavar="TIME", help="RFC 3339, relative, or now.")] = "now",
    limit: Annotated[int, typer.Option("--limit", "-n", min=1, max=10_000, metavar="COUNT", help="At most.")] = 100,
    gateway: GatewayOption = "",
    output: FormatOption = Format.TEXT,
) -> None:
    """What happened between two times and rules can act on, the oldest first."""
    out, http = Output(output), open_gateway(gateway)
    query = {"type": kind, "robot": robot or None, "source": source or None, "start": start, "end": end}
    found: list[Any] = []
    after = None
    while len(found) < limit:
        most = min(PAGE, limit - len(found))
        page = http.get("/api/v1/happenings", **query, limit=most, after=after)
        found += page["happenings"]
        if (after := page["next"]) is None:
            break
    out.listing(("At (UTC)", "Type", "Robot", "Id", "Detail"), found, _event_row, empty="nothing happened")


def _event_row(item: Mapping[str, Any]) -> Sequence[object]:
    said = json.dumps(item["data"], ensure_ascii=False)
    return (
        *(moment(item["time"], seconds=True), item["type"], item.get("subject") or "–", item["id"]),
        said if len(said) <= WIDE else f"{said[: WIDE - 1]}…",
    )
