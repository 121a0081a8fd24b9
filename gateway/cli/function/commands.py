"""`metaros function`: programs of yours that run when something happens. Here is what looks at them."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from typing import Annotated, Any

import typer

from gateway.cli.function.alias import register as register_alias
from gateway.cli.function.dead_letters import register as register_dead
from gateway.cli.function.deploy import register as register_deploy
from gateway.cli.function.invoke import register as register_call
from gateway.cli.function.local import register as register_local
from gateway.cli.function.replay import register as register_replay
from gateway.cli.function.view import (
    CALL_HEADINGS,
    HEADINGS,
    FunctionName,
    call_row,
    function_path,
    function_row,
    show_function,
    show_runtime,
)
from metaros.cli.shared.gateway_http import GatewayOption, open_gateway
from metaros.cli.shared.options import Format, FormatOption
from metaros.cli.shared.output import Output, human_bytes, sanitize
from metaros.cli.shared.watch import WatchOption, watch

__all__ = ["register"]

PAGE = 200
Version = Annotated[str, typer.Option("--version", metavar="VERSION", help="Or an alias; default: $LATEST.")]


def register(app: typer.Typer) -> None:
    """Add the noun to `metaros`."""
    noun = typer.Typer(no_args_is_help=True, help="Programs of yours that run when something happens.")
    register_local(noun)
    register_deploy(noun)
    register_call(noun)
    for name, command in (
        ("list", _list),
        ("show", _show),
        ("invocations", _invocations),
        ("code", _code),
        ("delete", _delete),
        ("runtime", _runtime),
    ):
        noun.command(name)(command)
    register_alias(noun)
    register_replay(noun)
    register_dead(noun)
    app.add_typer(noun, name="function")


def _list(
    text: Annotated[str, typer.Option("--text", "-t", metavar="TEXT", help="In the name.")] = "",
    again: WatchOption = False,
    gateway: GatewayOption = "",
    output: FormatOption = Format.TEXT,
) -> None:
    """The functions of a gateway, with what they did in the last hour."""
    out, http = Output(output), open_gateway(gateway)

    def show(found: list[Any]) -> None:
        empty = "no functions yet: `metaros function init` begins one"
        out.listing(HEADINGS, found, function_row, empty=empty, right=(4, 5, 6))

    watch(out, lambda: list(http.pages("/api/v1/functions", "functions", q=text or None)), show, again=again)


def _show(name: FunctionName, gateway: GatewayOption = "", output: FormatOption = Format.TEXT) -> None:
    """One function: its settings, what calls it, its aliases, and how it does."""
    out, http = Output(output), open_gateway(gateway)
    found = http.get(function_path(name))
    if out.json:
        out.objects(found)
    else:
        show_function(out, found, origin=http.url)


def _invocations(
    name: FunctionName,
    status: Annotated[
        str, typer.Option("--status", metavar="ok|error|timeout|throttled", help="Only those that ended so.")
    ] = "",
    robot: Annotated[str, typer.Option("--robot", "-r", metavar="ROBOT", help="Only those about this robot.")] = "",
    version: Annotated[str, typer.Option("--version", metavar="VERSION", help="Only of this version.")] = "",
    limit: Annotated[int, typer.Option("--limit", "-n", min=1, max=10_000, metavar="COUNT", help="The newest.")] = 20,
    again: WatchOption = False,
    gateway: GatewayOption = "",
    output: FormatOption = Format.TEXT,
) -> None:
    """Calls that are over, the newest first."""
    out, http = Output(output), open_gateway(gateway)
    query = {"status": status or None, "robot": robot or None, "version": version or None}

    def find() -> list[Any]:
        found: list[Any] = []
        before = None
        while len(found) < limit:
            most = min(PAGE, limit - len(found))
            page = http.get(function_path(name, "/invocations"), **query, limit=most, before=before)
            found += page["invocations"]
            if (before := page["next"]) is None:
                break
        return found

    empty = f"{sanitize(name)} was not called yet"
    watch(
        out,
        find,
        lambda found: out.listing(CALL_HEADINGS, found, call_row, empty=empty, right=(4, 5, 6)),
        again=again,
    )


def _code(
    name: FunctionName,
    path: Annotated[str, typer.Argument(metavar="FILE", help="Print this file; none: list them all.")] = "",
    version: Version = "$LATEST",
    gateway: GatewayOption = "",
    output: FormatOption = Format.TEXT,
) -> None:
    """The files of a function's code, or one of them."""
    out, http = Output(output), open_gateway(gateway)
    if path:
        query = {"path": path, "version": version}
        with http.open("GET", function_path(name, "/code/text"), query=query) as answer:
            found = json.loads(b"".join(answer.pieces()))
        if out.json:
            out.objects(found)
            return
        out.line(found["text"].removesuffix("\n"))
        if found["truncated"]:
            out.note("it goes on; that much is shown")
        return
    found = http.get(function_path(name, "/code"), version=version)
    if out.json:
        out.objects(found)
        return
    out.table(("File", "Size"), [_file_row(item) for item in found["files"]], right=(1,))
    if found["truncated"]:
        out.note("there are more files")


def _file_row(item: Mapping[str, Any]) -> Sequence[object]:
    return (item["path"], human_bytes(item["size_bytes"]))


def _delete(name: FunctionName, gateway: GatewayOption = "", output: FormatOption = Format.TEXT) -> None:
    """Delete a function with its versions and aliases; events for it become dead letters."""
    out = Output(output)
    open_gateway(gateway).delete(function_path(name))
    if out.json:
        out.objects({"deleted": name})
    else:
        out.line(f"{sanitize(name)}: deleted")


def _runtime(gateway: GatewayOption = "", output: FormatOption = Format.TEXT) -> None:
    """Where functions run: the sandbox, why it is no stronger, and the workers."""
    out, http = Output(output), open_gateway(gateway)
    found = http.get("/api/v1/functions-runtime")
    if out.json:
        out.objects(found)
    else:
        show_runtime(out, found)
