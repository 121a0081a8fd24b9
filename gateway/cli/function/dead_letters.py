"""`metaros function dead …`: what could not be delivered, delivered again or dropped."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Annotated, Any

import typer

from gateway.cli.function.view import moment
from metaros.cli.shared.gateway_http import GatewayOption, open_gateway, path_part
from metaros.cli.shared.options import Format, FormatOption
from metaros.cli.shared.output import Output, counted, sanitize
from metaros.errors import UsageError

__all__ = ["register"]

PATH = "/api/v1/dead-letters"
PAGE = 200
Ids = Annotated[list[str] | None, typer.Argument(metavar="[ID]...", help="As `metaros function dead list` shows them.")]
Kind = Annotated[str, typer.Option("--kind", metavar="KIND", help="Of targets: function, webhook, command …")]
Target = Annotated[str, typer.Option("--target", metavar="TARGET", help="A function, or RULE/TARGET.")]
Every = Annotated[bool, typer.Option("--all", help="Every one.")]


def register(noun: typer.Typer) -> None:
    """Add the verbs to the noun."""
    dead = typer.Typer(no_args_is_help=True, help="What could not be delivered, whatever its target.")
    for name, command in (("list", _list), ("show", _show), ("redrive", _redrive), ("drop", _drop)):
        dead.command(name)(command)
    noun.add_typer(dead, name="dead")


def _list(
    kind: Kind = "",
    target: Target = "",
    limit: Annotated[int, typer.Option("--limit", "-n", min=1, max=10_000, metavar="COUNT", help="The newest.")] = 50,
    gateway: GatewayOption = "",
    output: FormatOption = Format.TEXT,
) -> None:
    """Dead letters, the newest first."""
    out, http = Output(output), open_gateway(gateway)
    found: list[Any] = []
    before = None
    while len(found) < limit:
        most = min(PAGE, limit - len(found))
        page = http.get(PATH, kind=kind or None, target=target or None, limit=most, before=before)
        found += page["dead_letters"]
        if (before := page["next"]) is None:
            break
    names = ("Dead letter", "Ended (UTC)", "Target", "Robot", "Tries", "Why")
    out.listing(names, found, _row, empty="no dead letters: everything was delivered", right=(4,))


def _row(item: Mapping[str, Any]) -> Sequence[object]:
    why = f"{item['code']}: {item['message']}" if item["message"] else item["code"]
    return (
        *(item["id"], moment(item["ended"], seconds=True), f"{item['kind']} {item['target']}"),
        *(item["robot"] or "–", item["tries"], why if len(why) <= 80 else f"{why[:79]}…"),
    )


def _show(
    letter: Annotated[str, typer.Argument(metavar="ID", help="As `metaros function dead list` shows it.")],
    gateway: GatewayOption = "",
    output: FormatOption = Format.TEXT,
) -> None:
    """One dead letter, with what its target would have got."""
    out, http = Output(output), open_gateway(gateway)
    found = http.get(f"{PATH}/{path_part(letter)}")
    if out.json:
        out.objects(found)
        return
    for name in ("id", "kind", "target", "happening", "robot", "code", "message", "tries", "born", "ended"):
        if found[name] != "":
            out.line(f"  {out.style(name.ljust(9), '2')}  {sanitize(str(found[name]))}")
    out.line()
    out.line(sanitize(found["payload"]) + (" …" if found["truncated"] else ""))


def _redrive(
    letters: Ids = None,
    kind: Kind = "",
    target: Target = "",
    every: Every = False,
    gateway: GatewayOption = "",
    output: FormatOption = Format.TEXT,
) -> None:
    """Deliver dead letters again, as if they had just been accepted."""
    out = Output(output)
    _one_way(letters, kind, target, every)
    asked = {"ids": letters or [], "kind": kind, "target": target, "all": every}
    done = open_gateway(gateway).post(f"{PATH}/redrive", asked)
    if out.json:
        out.objects(done)
    else:
        out.line(f"{counted(done['redriven'], 'dead letter')} on the way again")


def _drop(
    letters: Ids = None,
    kind: Kind = "",
    target: Target = "",
    every: Every = False,
    gateway: GatewayOption = "",
    output: FormatOption = Format.TEXT,
) -> None:
    """Drop dead letters for good."""
    import json

    out = Output(output)
    _one_way(letters, kind, target, every)
    asked = {"id": letters or None, "kind": kind or None, "target": target or None, "all": "true" if every else None}
    with open_gateway(gateway).open("DELETE", PATH, query=asked) as answer:
        done = json.loads(b"".join(answer.pieces()))
    if out.json:
        out.objects(done)
    else:
        out.line(f"{counted(done['dropped'], 'dead letter')} dropped")


def _one_way(letters: list[str] | None, kind: str, target: str, every: bool) -> None:
    if not (letters or kind or target or every):
        raise UsageError("say which: some by id, --kind, --target, or --all")
