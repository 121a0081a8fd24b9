"""`metaros function alias …`: versions, names for them, and canaries that go back by themselves."""

from __future__ import annotations

import json
from typing import Annotated, Any

import typer

from gateway.cli.function.view import FunctionName, function_path, moment
from gateway.cli.time_span import span_s
from metaros.cli.shared.gateway_http import GatewayClient, GatewayOption, open_gateway, path_part
from metaros.cli.shared.options import Format, FormatOption
from metaros.cli.shared.output import Output, counted, sanitize
from metaros.errors import UsageError

__all__ = ["register"]

Alias = Annotated[str, typer.Argument(metavar="ALIAS", help="A name such as live.")]


def register(noun: typer.Typer) -> None:
    """Add the verbs to the noun."""
    for name, command in (("versions", _versions), ("alias", _alias), ("canary", _canary)):
        noun.command(name)(command)


def _versions(
    name: FunctionName,
    publish: Annotated[bool, typer.Option("--publish", help="First make one of what is deployed now.")] = False,
    gateway: GatewayOption = "",
    output: FormatOption = Format.TEXT,
) -> None:
    """The versions of a function: what was published, and never changes."""
    out, http = Output(output), open_gateway(gateway)
    if publish:
        made = http.post(function_path(name, "/versions"), {})
        out.note(f"{sanitize(name)}: version {made['version']}")
    found = http.get(function_path(name))["published"]
    out.listing(
        ("Version", "Published (UTC)", "Code", "Description"),
        found,
        lambda one: (one["version"], moment(one["modified"]), one["code_sha256"][:12], one["description"] or "–"),
        empty=f"{sanitize(name)} has no version; make one with --publish",
    )


def _alias(
    name: FunctionName,
    alias: Annotated[str, typer.Argument(metavar="ALIAS", help="A name such as live; none: list them.")] = "",
    version: Annotated[str, typer.Argument(metavar="VERSION", help="That it leads to.")] = "",
    weight: Annotated[
        str, typer.Option("--weight", metavar="VERSION=SHARE", help="And a share of the calls to another, as 4=0.1.")
    ] = "",
    delete: Annotated[bool, typer.Option("--delete", help="Take the alias away.")] = False,
    gateway: GatewayOption = "",
    output: FormatOption = Format.TEXT,
) -> None:
    """Let a name lead to a version, and maybe a share of its calls to another one."""
    out, http = Output(output), open_gateway(gateway)
    if not alias:
        found = http.get(function_path(name))["aliases"]
        out.listing(
            ("Alias", "Version", "Others", "Canary", "Description"),
            found,
            lambda one: (
                *(one["name"], one["version"], _weights(one) or "–"),
                *(one["canary"]["state"] if one["canary"] else "–", one["description"] or "–"),
            ),
            empty=f"{sanitize(name)} has no alias",
        )
        return
    path = function_path(name, f"/aliases/{path_part(alias)}")
    if delete:
        http.delete(path)
        if out.json:
            out.objects({"deleted": alias})
        else:
            out.line(f"{sanitize(name)}:{sanitize(alias)}: gone")
        return
    if not version:
        raise UsageError(f"which version does {alias} lead to?\n`metaros function versions {name}` lists them")
    done = _put(http, path, {"version": version, "weights": _shares(weight)})
    if out.json:
        out.objects(done)
    else:
        others = _weights(done)
        out.line(
            f"{sanitize(name)}:{sanitize(alias)} leads to version {done['version']}{f', {others}' if others else ''}"
        )


def _canary(
    name: FunctionName,
    alias: Alias,
    version: Annotated[str, typer.Argument(metavar="VERSION", help="The new one; none: how the canary is.")] = "",
    weight: Annotated[float, typer.Option("--weight", metavar="SHARE", help="Of the calls, at first.")] = 0.1,
    error_rate: Annotated[
        float, typer.Option("--error-rate", metavar="SHARE", help="Back as soon as more of its calls fail.")
    ] = 0.05,
    least: Annotated[int, typer.Option("--least", min=1, metavar="COUNT", help="Calls before that is judged.")] = 20,
    for_: Annotated[str, typer.Option("--for", metavar="SPAN", help="How long a step lasts.")] = "5m",
    step: Annotated[
        float, typer.Option("--step", metavar="SHARE", help="How much more at each step; 0: all at once.")
    ] = 0.0,
    cancel: Annotated[bool, typer.Option("--cancel", help="Back to the version before.")] = False,
    gateway: GatewayOption = "",
    output: FormatOption = Format.TEXT,
) -> None:
    """Give a new version a share of an alias' calls; it is rolled back by itself where too many of them fail."""
    out, http = Output(output), open_gateway(gateway)
    path = function_path(name, f"/aliases/{path_part(alias)}/canary")
    if cancel:
        done = http.delete(path)
    elif version:
        asked = {"version": version, "weight": weight, "error_rate": error_rate, "least_invocations": least}
        done = _put(http, path, {**asked, "for_s": span_s(for_, "--for"), "step": step})
    else:
        found = [one for one in http.get(function_path(name))["aliases"] if one["name"] == alias]
        if not found:
            raise UsageError(f"{name} has no alias {alias}")
        done = found[0]["canary"]
    if out.json:
        out.objects(done)
    elif done is None:
        out.note(f"{sanitize(name)}:{sanitize(alias)} has no canary")
    else:
        state = done["reason"] or done["state"]
        calls = f"{counted(done['invocations'], 'call')}, {counted(done['errors'], 'error')}"
        share = f"version {done['version']} with {done['weight'] * 100:g} %, beside version {done['stable']}"
        out.line(sanitize(f"{name}:{alias}: {state}; {share}; {calls}"))


def _put(http: GatewayClient, path: str, body: dict[str, Any]) -> Any:
    with http.open("PUT", path, body=body) as answer:
        return json.loads(b"".join(answer.pieces()))


def _weights(alias: dict[str, Any]) -> str:
    return ", ".join(f"{share * 100:g} % to version {version}" for version, share in alias["weights"].items())


def _shares(text: str) -> dict[str, float]:
    version, sign, share = text.partition("=")
    if not text:
        return {}
    try:
        found = float(share)
    except ValueError:
        found = -1.0
    if not (sign and version and 0.0 <= found <= 1.0):
        raise UsageError(f"--weight {text}: not a version and its share from 0 to 1, as 4=0.1")
    return {version: found}
