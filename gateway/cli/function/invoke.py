"""`metaros function invoke …`: a function called by hand, what it prints, and events to call it with."""

from __future__ import annotations

import contextlib
import json
from typing import Annotated, Any

import typer

from gateway.automation.functions.example_events import EXAMPLE_EVENTS
from gateway.cli.function.json_input import payload_of
from gateway.cli.function.view import FunctionName, function_path, log_line, show_outcome
from metaros.cli.shared.gateway_http import GatewayClient, GatewayOption, events, open_gateway
from metaros.cli.shared.options import Format, FormatOption
from metaros.cli.shared.output import Output, sanitize
from metaros.errors import PeerError, UsageError

__all__ = ["Data", "Event", "register"]

CALL_S = 5500.0  # the longest that a function may take, and some more

Data = Annotated[str, typer.Option("--data", "-d", metavar="JSON|@FILE|-", help="What it is called with; default: {}.")]
Event = Annotated[str, typer.Option("--event", "-e", metavar="EVENT", help="As `metaros function events` lists them.")]


def register(noun: typer.Typer) -> None:
    """Add the verbs to the noun."""
    for name, command in (("invoke", _invoke), ("logs", _logs), ("events", _events)):
        noun.command(name)(command)


def _invoke(
    name: FunctionName,
    data: Data = "",
    event: Event = "",
    qualifier: Annotated[
        str, typer.Option("--qualifier", metavar="VERSION", help="A version or an alias; default: $LATEST.")
    ] = "",
    later: Annotated[bool, typer.Option("--async", help="Only put it into the queue, which tries it again.")] = False,
    tail: Annotated[bool, typer.Option("--tail", help="With the end of its log.")] = False,
    gateway: GatewayOption = "",
    output: FormatOption = Format.TEXT,
) -> None:
    """Call a function, and print what it returns. Exit code 1 where it fails."""
    out, payload = Output(output), payload_of(data, event)
    http = GatewayClient(open_gateway(gateway).url, timeout_s=CALL_S)
    query = {"qualifier": qualifier or None, "kind": "event" if later else "request"}
    content, headers = json.dumps(payload).encode(), {"Content-Type": "application/json"}
    with http.open("POST", function_path(name, "/invoke"), query=query, headers=headers, content=content) as answer:
        done = json.loads(b"".join(answer.pieces()))
    if out.json:
        out.objects(done)
    elif later:
        out.line(sanitize(done["request_id"]))
        out.note(f"accepted: it will be called at least once; see metaros function invocations {name}")
    else:
        show_outcome(out, done, tail=tail)
    if done["status"] in ("error", "timeout"):
        raise typer.Exit(1)


def _logs(
    name: FunctionName,
    follow: Annotated[bool, typer.Option("--follow", "-f", help="And what comes, until Ctrl-C.")] = False,
    limit: Annotated[int, typer.Option("--limit", "-n", min=1, max=1000, metavar="COUNT", help="Lines.")] = 200,
    gateway: GatewayOption = "",
    output: FormatOption = Format.TEXT,
) -> None:
    """What a function printed last, on whatever machine it was called from."""
    out, http = Output(output), open_gateway(gateway)
    lines = http.get(function_path(name, "/logs"), limit=limit)["lines"]
    if out.json and not follow:
        out.objects(lines)
        return
    for line in lines:
        _print(out, line)
    if not follow:
        if not lines:
            out.note(f"{sanitize(name)} printed nothing that is still there")
        return
    query = {"after": lines[-1]["cursor"] if lines else None}
    headers = {"Accept": "text/event-stream"}
    with (
        contextlib.suppress(KeyboardInterrupt),
        http.open("GET", function_path(name, "/logs"), query=query, headers=headers) as answer,
    ):
        for _, line in events(answer):
            _print(out, line)
        raise PeerError("the gateway ended the log\nrun it again: it goes on with what is printed now")


def _print(out: Output, line: dict[str, Any]) -> None:
    if out.json:
        out.object_line(line)
        return
    at = out.style(line["at"][11:23], "2")
    for text in line["text"].rstrip("\n").split("\n"):
        out.line(f"{at}  {log_line(out, text)}")


def _events(
    event: Annotated[str, typer.Argument(metavar="EVENT", help="Print this one; none: list them.")] = "",
    output: FormatOption = Format.TEXT,
) -> None:
    """Events to try a function with, each as the real one looks."""
    out = Output(output)
    if event:
        if event not in EXAMPLE_EVENTS:
            raise UsageError(f"there is no event {event}; there are {', '.join(EXAMPLE_EVENTS)}")
        found = EXAMPLE_EVENTS[event].event
        if out.json:
            out.objects(found)
        else:
            out.line(json.dumps(found, indent=2, ensure_ascii=False))
        return
    rows = [{"name": row.name, "meaning": row.meaning} for row in EXAMPLE_EVENTS.values()]
    out.listing(("Event", "When"), rows, lambda item: (item["name"], item["meaning"]))
