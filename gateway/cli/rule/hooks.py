"""`metaros rule hook …`: endpoints for incoming webhooks."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Annotated, Any

import typer

from gateway.cli.function.view import moment
from metaros.cli.shared.gateway_http import GatewayOption, open_gateway, path_part
from metaros.cli.shared.options import Format, FormatOption
from metaros.cli.shared.output import Output, sanitize

__all__ = ["register"]

HookName = Annotated[str, typer.Argument(metavar="HOOK", help="Its name.")]
ONCE = "its secret; nobody is shown it again"


def register(noun: typer.Typer) -> None:
    """Add the verbs to the noun."""
    hook = typer.Typer(no_args_is_help=True, help="Endpoints for others' webhooks.")
    for name, command in (("create", _create), ("list", _list), ("rotate", _rotate), ("delete", _delete)):
        hook.command(name)(command)
    noun.add_typer(hook, name="hook")


def _create(
    hook: HookName,
    auth: Annotated[
        str,
        typer.Option(
            "--auth", metavar="signature|bearer", help="Signed by Standard Webhooks, or with the secret itself."
        ),
    ] = "signature",
    robot: Annotated[str, typer.Option("--robot", "-r", metavar="ROBOT", help="Whom what comes in is about.")] = "",
    description: Annotated[str, typer.Option("--description", metavar="TEXT", help="For whoever reads it.")] = "",
    gateway: GatewayOption = "",
    output: FormatOption = Format.TEXT,
) -> None:
    """Create an endpoint for webhooks; its secret is shown this once."""
    out, http = Output(output), open_gateway(gateway)
    done = http.post("/api/v1/hooks", {"name": hook, "auth": auth, "robot": robot, "description": description})
    if out.json:
        out.objects(done)
        return
    out.line(f"POST {http.url}{sanitize(done['path'])}")
    out.line(sanitize(done["secret"]))
    out.note(ONCE)


def _list(gateway: GatewayOption = "", output: FormatOption = Format.TEXT) -> None:
    """The hooks, and what came in by them."""
    out = Output(output)
    found = list(open_gateway(gateway).pages("/api/v1/hooks", "hooks"))
    names = ("Hook", "Path", "Proof", "Robot", "Came in", "Refused", "Last (UTC)", "Made by")
    out.listing(names, found, _hook_row, empty="no hooks", right=(4, 5))


def _hook_row(item: Mapping[str, Any]) -> Sequence[object]:
    last = moment(item["last_used"], seconds=True) if item["last_used"] else "–"
    return (
        *(item["name"], item["path"], item["auth"], item["robot"] or "–"),
        *(item["accepted"], item["refused"], last, item["made_by"]),
    )


def _rotate(hook: HookName, gateway: GatewayOption = "", output: FormatOption = Format.TEXT) -> None:
    """Another secret, at once: what is sent with the one before is refused."""
    out = Output(output)
    done = open_gateway(gateway).post(f"/api/v1/hooks/{path_part(hook)}/rotate", {})
    if out.json:
        out.objects(done)
    else:
        out.line(sanitize(done["secret"]))
        out.note(ONCE)


def _delete(hook: HookName, gateway: GatewayOption = "", output: FormatOption = Format.TEXT) -> None:
    """Close it: nothing comes in by it any more."""
    out = Output(output)
    open_gateway(gateway).delete(f"/api/v1/hooks/{path_part(hook)}")
    if out.json:
        out.objects({"deleted": hook})
    else:
        out.line(f"{sanitize(hook)}: gone")
