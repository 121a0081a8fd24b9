"""`metaros rule`: what is done when something happens. Here is what looks at rules and changes them."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Annotated, Any

import typer

from gateway.cli.function.view import moment
from gateway.cli.rule.check import register as register_try
from gateway.cli.rule.events import register as register_events
from gateway.cli.rule.file import read_rules
from gateway.cli.rule.hooks import register as register_hooks
from gateway.cli.rule.view import HEADINGS, RuleName, rule_path, rule_row, show_rule
from metaros.cli.shared.gateway_http import GatewayOption, open_gateway, path_part
from metaros.cli.shared.options import Format, FormatOption
from metaros.cli.shared.output import Output, sanitize
from metaros.cli.shared.watch import WatchOption, watch

__all__ = ["register"]

RuleFile = Annotated[
    Path, typer.Argument(metavar="FILE", help="YAML or JSON: a rule, or several; - is standard input.")
]


def register(app: typer.Typer) -> None:
    """Add the noun to `metaros`."""
    noun = typer.Typer(no_args_is_help=True, help="What is done when something happens.")
    for name, command in (
        ("list", _list),
        ("show", _show),
        ("put", _put),
        ("enable", _enable),
        ("disable", _disable),
        ("delete", _delete),
        ("history", _history),
        ("secret", _secret),
    ):
        noun.command(name)(command)
    register_try(noun)
    register_hooks(noun)
    register_events(noun)
    app.add_typer(noun, name="rule")


def _list(
    text: Annotated[str, typer.Option("--text", "-t", metavar="TEXT", help="In the rule's text.")] = "",
    again: WatchOption = False,
    gateway: GatewayOption = "",
    output: FormatOption = Format.TEXT,
) -> None:
    """The rules of a gateway, with what they did."""
    out, http = Output(output), open_gateway(gateway)

    def show(found: list[Any]) -> None:
        out.listing(HEADINGS, found, rule_row, empty="no rules yet: `metaros rule put FILE` adds one", right=(4, 5))

    watch(out, lambda: list(http.pages("/api/v1/rules", "rules", q=text or None)), show, again=again)


def _show(
    rule: RuleName,
    document: Annotated[bool, typer.Option("--document", help="Only the document, as YAML to edit and put.")] = False,
    gateway: GatewayOption = "",
    output: FormatOption = Format.TEXT,
) -> None:
    """One rule: what it waits for, what it does, and what it did."""
    out, http = Output(output), open_gateway(gateway)
    found = http.get(rule_path(rule))
    if out.json and not document:
        out.objects(found)
    else:
        show_rule(out, found, origin=http.url, only_document=document)


def _put(file: RuleFile, gateway: GatewayOption = "", output: FormatOption = Format.TEXT) -> None:
    """Add the rules of a file, or put them in place of those that there are. They hold at once."""
    out, http = Output(output), open_gateway(gateway)
    done = []
    for rule in read_rules(file):
        with http.open("PUT", rule_path(rule["name"]), body=rule) as answer:
            made, new = json.loads(b"".join(answer.pieces())), answer.status == 201
        done.append(made)
        if not out.json:
            what = "added" if new else "changed"
            off = "" if made["enabled"] else ", off"
            out.line(f"{out.style('✓', '32')} {sanitize(made['name'])}: {what}, revision {made['revision']}{off}")
    if out.json:
        out.objects(done)


def _enable(rule: RuleName, gateway: GatewayOption = "", output: FormatOption = Format.TEXT) -> None:
    """Turn a rule on."""
    _turn(rule, "enable", "on", gateway, output)


def _disable(rule: RuleName, gateway: GatewayOption = "", output: FormatOption = Format.TEXT) -> None:
    """Turn a rule off: it forgets what it waits for."""
    _turn(rule, "disable", "off", gateway, output)


def _turn(rule: str, verb: str, word: str, gateway: str, output: Format) -> None:
    out = Output(output)
    done = open_gateway(gateway).post(rule_path(rule, f"/{verb}"), {})
    if out.json:
        out.objects(done)
    else:
        out.line(f"{sanitize(rule)}: {word}")


def _delete(rule: RuleName, gateway: GatewayOption = "", output: FormatOption = Format.TEXT) -> None:
    """Take a rule away. What it set off is delivered all the same."""
    out = Output(output)
    open_gateway(gateway).delete(rule_path(rule))
    if out.json:
        out.objects({"deleted": rule})
    else:
        out.line(f"{sanitize(rule)}: deleted")


def _history(
    rule: RuleName,
    limit: Annotated[int, typer.Option("--limit", "-n", min=1, max=100, metavar="COUNT", help="The newest.")] = 20,
    gateway: GatewayOption = "",
    output: FormatOption = Format.TEXT,
) -> None:
    """Who changed a rule, and how, the newest first."""
    out = Output(output)
    found = open_gateway(gateway).get(rule_path(rule, "/history"), limit=limit)["entries"]
    out.listing(("Revision", "At (UTC)", "What", "By"), found, _change_row)


def _change_row(item: Mapping[str, Any]) -> Sequence[object]:
    return (item["revision"], moment(item["at"], seconds=True), item["what"], item["by"])


def _secret(
    rule: RuleName,
    target: Annotated[str, typer.Argument(metavar="TARGET", help="The id of a webhook among its targets.")],
    gateway: GatewayOption = "",
    output: FormatOption = Format.TEXT,
) -> None:
    """Make a new secret that signs what a webhook is sent, in place of the one before; it is shown this once."""
    out = Output(output)
    done = open_gateway(gateway).post(rule_path(rule, f"/targets/{path_part(target)}/secret"), {})
    if out.json:
        out.objects(done)
    else:
        out.line(sanitize(done["secret"]))
        out.note("whoever gets the webhook checks it with this (Standard Webhooks); nobody is shown it again")
