"""`metaros twin template`: parts of twins' documents for all robots that a selector names."""

from __future__ import annotations

from typing import Annotated, Any

import typer

from gateway.cli.twin_change import DryRun, Reason, read_document, send, show_changes, show_lines
from metaros.cli.shared.gateway_http import GatewayOption, open_gateway, path_part
from metaros.cli.shared.options import Format, FormatOption
from metaros.cli.shared.output import Output
from metaros.sanitize import sanitize

__all__ = ["add_templates"]

Name = Annotated[str, typer.Argument(metavar="NAME", help="The template's name.")]


def add_templates(app: typer.Typer) -> None:
    """Add `template` to the noun `twin`."""
    noun = typer.Typer(no_args_is_help=True, help="Parts of documents for all robots that a selector names.")
    for command in (_list, _show, _set, _remove, _history, _revert):
        noun.command(command.__name__.removeprefix("_"))(command)
    app.add_typer(noun, name="template")


def _list(gateway: GatewayOption = "", output: FormatOption = Format.TEXT) -> None:
    """Every template, in the order in which they are laid over each other."""
    out = Output(output)
    found = open_gateway(gateway).get("/api/v1/templates")["templates"]
    if out.json:
        out.objects(found)
        return
    names = ("Template", "Priority", "Robots", "Revision", "By", "Why")
    out.table(names, [_row(item) for item in found], empty="no templates", right=(1, 3))


def _show(name: Name, gateway: GatewayOption = "", output: FormatOption = Format.TEXT) -> None:
    """One template's document."""
    out = Output(output)
    found = open_gateway(gateway).get(f"/api/v1/templates/{path_part(name)}")
    if out.json:
        out.objects(found)
        return
    out.note(f"for {found['selector'] or 'every robot'}, priority {found['priority']}, revision {found['revision']}")
    out.objects(found["document"])


def _set(
    name: Name,
    file: Annotated[str, typer.Argument(metavar="FILE|-|JSON", help="A JSON file, - for standard input, or {…}.")],
    selector: Annotated[
        str, typer.Option("--selector", "-l", metavar="TERMS", help="The robots it is for; default: every one.")
    ] = "",
    priority: Annotated[
        int, typer.Option("--priority", min=-1000, max=1000, metavar="N", help="The higher, the later it is laid on.")
    ] = 0,
    dry_run: DryRun = False,
    reason: Reason = "",
    confirm_s: Annotated[
        float, typer.Option("--confirm-s", min=5.0, max=3600.0, metavar="SECONDS", help="The robots' confirm window.")
    ] = 60.0,
    gateway: GatewayOption = "",
    output: FormatOption = Format.TEXT,
) -> None:
    """Add a template or put another in its place: every robot takes it that it names, or none does."""
    body = {"selector": selector, "priority": priority, "document": read_document(file)}
    query = {"dry_run": dry_run, "reason": reason, "confirm_within_s": confirm_s}
    path = f"/api/v1/templates/{path_part(name)}"
    show_changes(Output(output), send(open_gateway(gateway), "PUT", path, body, query=query))


def _remove(
    name: Name,
    dry_run: DryRun = False,
    reason: Reason = "",
    gateway: GatewayOption = "",
    output: FormatOption = Format.TEXT,
) -> None:
    """Take a template away; robots go on with what is left."""
    query = {"dry_run": dry_run, "reason": reason}
    path = f"/api/v1/templates/{path_part(name)}"
    show_changes(Output(output), send(open_gateway(gateway), "DELETE", path, {}, query=query))


def _history(
    name: Name,
    limit: Annotated[int, typer.Option("--limit", "-n", min=1, max=100, metavar="COUNT", help="The newest.")] = 20,
    gateway: GatewayOption = "",
    output: FormatOption = Format.TEXT,
) -> None:
    """Who changed it, when and why, also when it is gone; the newest first."""
    out = Output(output)
    path = f"/api/v1/templates/{path_part(name)}/history"
    found = open_gateway(gateway).get(path, limit=limit)["entries"]
    if out.json:
        out.objects(found)
        return
    for item in found:
        what = "removed" if item["removed"] else f"for {item['selector'] or 'every robot'}, priority {item['priority']}"
        who, why = sanitize(item["author"]), sanitize(item["reason"])
        out.line(f"{item['revision']}  {item['at'][:19]}Z  {who}  {what}  {why}".rstrip())
        show_lines(out, item["changes"], indent="    ")


def _revert(
    name: Name,
    revision: Annotated[int, typer.Argument(min=1, metavar="REVISION", help="Of `metaros twin template history`.")],
    dry_run: DryRun = False,
    reason: Reason = "",
    gateway: GatewayOption = "",
    output: FormatOption = Format.TEXT,
) -> None:
    """Put the template of an earlier revision in its place, also one that is gone."""
    query = {"dry_run": dry_run, "reason": reason}
    path = f"/api/v1/templates/{path_part(name)}/revert"
    show_changes(Output(output), send(open_gateway(gateway), "POST", path, {"revision": revision}, query=query))


def _row(item: dict[str, Any]) -> tuple[str, ...]:
    who, why = sanitize(item["author"]), sanitize(item["reason"])
    return item["name"], str(item["priority"]), item["selector"] or "every", str(item["revision"]), who, why or "–"
