"""`metaros function deploy`: a folder of code becomes a function of the gateway, or a new version of one."""

from __future__ import annotations

import base64
import json
import re
from pathlib import Path
from typing import Annotated, Any

import typer

from gateway.cli.function.json_input import variables
from gateway.cli.function.manifest import handler_of, read_manifest
from gateway.cli.function.pack import Packed, pack
from gateway.cli.function.view import function_path
from gateway.cli.time_span import span_s
from metaros.cli.shared.gateway_http import GatewayClient, GatewayOption, open_gateway
from metaros.cli.shared.options import Format, FormatOption
from metaros.cli.shared.output import Output, counted, human_bytes, sanitize
from metaros.errors import RefusedError, UsageError

__all__ = ["Source", "register"]

BASE64_BYTES = 11 * 1024 * 1024  # of a zip file that fits into a JSON request; a larger one goes by itself
ZIP_TYPE = "application/zip"
NAME = re.compile(r"[A-Za-z0-9_-]{1,64}")
BUS = "arn:aws:events:local:000000000000:event-bus/default"

Source = Annotated[Path, typer.Argument(metavar="FOLDER", help="The code: a folder, a Python file or a zip file.")]
Handler = Annotated[str, typer.Option("--handler", metavar="MODULE.FUNCTION", help="What is called; app.handler.")]


def register(noun: typer.Typer) -> None:
    """Add the verb to the noun."""
    noun.command("deploy")(_deploy)


def _deploy(
    source: Source,
    name: Annotated[str, typer.Option("--name", metavar="NAME", help="Default: function.yaml's, the folder's.")] = "",
    handler: Handler = "",
    timeout: Annotated[str, typer.Option("--timeout", metavar="SPAN", help="Of a call: 10s, 5m.")] = "",
    memory: Annotated[int, typer.Option("--memory", metavar="MB", help="Of a worker, 128 or more.")] = 0,
    env: Annotated[
        list[str] | None, typer.Option("--env", metavar="NAME=VALUE", help="A variable; may be repeated.")
    ] = None,
    layer: Annotated[list[str] | None, typer.Option("--layer", metavar="ARN", help="May be repeated.")] = None,
    description: Annotated[str, typer.Option("--description", metavar="TEXT", help="For whoever reads it.")] = "",
    publish: Annotated[bool, typer.Option("--publish", help="Make a version of it, which never changes.")] = False,
    alias: Annotated[str, typer.Option("--alias", metavar="ALIAS", help="That leads to the new version.")] = "",
    reserved: Annotated[
        int | None, typer.Option("--reserved", min=-1, metavar="COUNT", help="Most calls at a time; -1: no bound.")
    ] = None,
    warm: Annotated[
        int | None, typer.Option("--warm", min=0, metavar="COUNT", help="Workers kept ready for --alias.")
    ] = None,
    retries: Annotated[
        int | None, typer.Option("--retries", min=0, max=2, metavar="COUNT", help="Of an event that fails; 2.")
    ] = None,
    on_success: Annotated[
        str, typer.Option("--on-success", metavar="ARN|bus", help="Where results of events go; bus: to the rules.")
    ] = "",
    on_failure: Annotated[
        str, typer.Option("--on-failure", metavar="ARN|bus", help="Where events go that failed for good.")
    ] = "",
    gateway: GatewayOption = "",
    output: FormatOption = Format.TEXT,
) -> None:
    """Deploy code as a function; what is not said stays as it is. The same code twice is the same version."""
    out, http = Output(output), open_gateway(gateway)
    if warm is not None and not alias:
        raise UsageError("--warm keeps workers of an alias\nsay which: --alias live")
    said, packed = read_manifest(source), pack(source)
    name = _named(name or str(said.pop("name", "")), source)
    said.pop("name", None)
    settings: dict[str, Any] = {"handler": handler, "timeout_s": span_s(timeout, "--timeout") if timeout else None}
    settings |= {"memory_mb": memory, "environment": variables(env or []), "layers": layer, "description": description}
    tried = {"most_retries": retries, "on_success": _end(on_success), "on_failure": _end(on_failure)}
    body = {**said, **_given(settings), **_given({"event_invoke": _given(tried)})}
    body |= {key: value for key, value in {"reserved": reserved, "warm": warm}.items() if value is not None}
    body |= {"publish": True, "alias": alias} if publish or alias else {}
    left = f", {counted(packed.left_out, 'thing')} left out" if packed.left_out else ""
    out.note(f"packed    {counted(packed.files, 'file')}, {human_bytes(len(packed.data))}{left}")
    found = _found(http, name)
    if found is None and "handler" not in body:
        body["handler"] = handler_of(packed, source)
    done = _send(http, name, packed, body)
    _report(out, done, found, alias=alias, published=publish or bool(alias))


def _given(settings: dict[str, Any]) -> dict[str, Any]:
    """Those that somebody said; no retries are something that was said."""
    found = {key: value for key, value in settings.items() if value or (value == 0 and key == "most_retries")}
    if "timeout_s" in found:
        found["timeout_s"] = max(1, round(found["timeout_s"]))
    return found


def _named(name: str, source: Path) -> str:
    """The function's name; the folder's or file's where nobody says one."""
    name = name or source.resolve().name.removesuffix(source.suffix if source.is_file() else "")
    if not NAME.fullmatch(name):
        raise UsageError(f"{name}: a function's name is 1 to 64 of letters, digits, '-' and '_'\nsay --name NAME")
    return name


def _end(text: str) -> str:
    return BUS if text == "bus" else text


def _found(http: GatewayClient, name: str) -> Any:
    """The function as it was; None for a new one."""
    try:
        return http.get(function_path(name))
    except RefusedError as error:
        if error.status == 404:
            return None
        raise


def _send(http: GatewayClient, name: str, packed: Packed, body: dict[str, Any]) -> Any:
    """Code and settings at once; a large zip file first and by itself."""
    if len(packed.data) <= BASE64_BYTES:
        body["zip"] = base64.b64encode(packed.data).decode()
    else:
        query = {"handler": body["handler"]} if "handler" in body else {}
        headers = {"Content-Type": ZIP_TYPE}
        with http.open("PUT", function_path(name, "/code"), query=query, headers=headers, content=packed.data):
            pass
    with http.open("PUT", function_path(name), body=body) as answer:
        return json.loads(b"".join(answer.pieces()))


def _report(out: Output, done: dict[str, Any], found: Any, *, alias: str, published: bool) -> None:
    if out.json:
        out.objects(done)
        return
    what = "made" if found is None else "changed"
    if found is not None and found["code_sha256"] == done["code_sha256"]:
        what = "the same code as before"
    version = f", version {done['published'][-1]['version']}" if published and done["published"] else ""
    leads = f", {alias} leads to it" if alias else ""
    out.line(f"{out.style('✓', '32')} {sanitize(done['name'])}: {what}{version}{sanitize(leads)}")
    out.note(f"call it   metaros function invoke {done['name']}")
    if not done["triggers"]:
        out.note("or        metaros rule put rules.yaml: a rule calls it when something happens")
