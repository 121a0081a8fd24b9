"""`metaros rule check …`: rules tried before they hold, against what was stored, and the times of schedules."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Annotated, Any

import typer

from gateway.cli.function.view import moment
from gateway.cli.rule.file import read_rules
from metaros.cli.shared.gateway_http import GatewayOption, open_gateway
from metaros.cli.shared.options import Format, FormatOption
from metaros.cli.shared.output import Output, counted, sanitize
from metaros.errors import UsageError

__all__ = ["register"]

NONE = "–"


def register(noun: typer.Typer) -> None:
    """Add the verbs to the noun."""
    for name, command in (
        ("check", _check),
        ("dry-run", _dry_run),
        ("schedules", _schedules),
        ("preview", _preview),
    ):
        noun.command(name)(command)


def _check(
    file: Annotated[Path, typer.Argument(metavar="FILE", help="YAML or JSON: a rule, or several; - is stdin.")],
    gateway: GatewayOption = "",
    output: FormatOption = Format.TEXT,
) -> None:
    """Say what is wrong with the rules of a file; nothing is stored. Exit code 1 where something is."""
    out, http = Output(output), open_gateway(gateway)
    found = [{"name": rule["name"], **http.post("/api/v1/rules/check", rule)} for rule in read_rules(file)]
    if out.json:
        out.objects(found)
    for one in found if not out.json else ():
        if one["ok"]:
            out.line(f"{out.style('✓', '32')} {sanitize(one['name'])}: good")
        for fault in one["faults"]:
            where = f"{fault['path']}: " if fault["path"] else ""
            out.line(f"{out.style('✗', '31')} {sanitize(one['name'])}: {sanitize(where + fault['message'])}")
    if not all(one["ok"] for one in found):
        raise typer.Exit(1)


def _dry_run(
    rule: Annotated[str, typer.Argument(metavar="RULE|FILE", help="One that is there, or a file with one.")],
    start: Annotated[str, typer.Option("--from", metavar="TIME", help="RFC 3339, or relative: -2h.")] = "-1h",
    until: Annotated[str, typer.Option("--until", metavar="TIME", help="RFC 3339, relative, or now.")] = "now",
    limit: Annotated[int, typer.Option("--limit", "-n", min=1, max=1000, metavar="COUNT", help="Firings.")] = 100,
    payload: Annotated[bool, typer.Option("--payload", help="With what each target would have got.")] = False,
    gateway: GatewayOption = "",
    output: FormatOption = Format.TEXT,
) -> None:
    """What a rule would have done with what is stored: on which robot, when, and with what. It does nothing."""
    out = Output(output)
    asked: dict[str, Any] = {"from": start, "until": until, "limit": limit}
    if Path(rule).is_file():
        found = read_rules(Path(rule))
        if len(found) != 1:
            raise UsageError(f"{rule}: a dry run is of one rule, and these are {len(found)}")
        asked["rule"] = found[0]
    else:
        asked["name"] = rule
    done = open_gateway(gateway).post("/api/v1/rules/dry-run", asked)
    if out.json:
        out.objects(done)
        return
    names = ("At (UTC)", "Robot", "Event", "Group", "Would go to")
    out.table(names, [_firing_row(one) for one in done["firings"]])
    for one in done["firings"] if payload else ():
        for target in one["targets"]:
            out.line(f"{sanitize(one['happening'])} → {sanitize(target['id'])}")
            out.line(json.dumps(target["payload"], indent=2, ensure_ascii=False))
    of = f"{counted(done['scanned'], 'event')} looked at, {done['matched']} matched, {done['fired']} would have fired"
    out.note(f"{of}{', and there is more' if done['truncated'] else ''}")
    if done["errors"]:
        out.note(f"{counted(done['errors'], 'error')}, the last: {sanitize(done['error'])}")


def _firing_row(item: Mapping[str, Any]) -> Sequence[object]:
    targets = ", ".join(f"{one['id']} ({one['kind']})" for one in item["targets"])
    at = moment(item["at"], seconds=True)
    return (at, item["robot"] or NONE, item["type"], item["group"] or NONE, targets or NONE)


def _schedules(gateway: GatewayOption = "", output: FormatOption = Format.TEXT) -> None:
    """Rules that fire by themselves, and when next."""
    out = Output(output)
    found = list(open_gateway(gateway).pages("/api/v1/schedules", "schedules"))
    names = ("Rule", "Schedule", "Time zone", "Missed", "Next (UTC)", "Last (UTC)")
    out.listing(names, found, _schedule_row, empty="no rule has a schedule")


def _schedule_row(item: Mapping[str, Any]) -> Sequence[object]:
    following, last = (moment(item[name], seconds=True) if item[name] else NONE for name in ("next", "last"))
    following = following if item["enabled"] else "off"
    return (item["rule"], item["expression"], item["timezone"], item["misfire"], following, last)


def _preview(
    expression: Annotated[
        str, typer.Argument(metavar="EXPRESSION", help="cron(…), rate(…) or at(…); a cron line of five fields.")
    ],
    timezone: Annotated[str, typer.Option("--timezone", metavar="ZONE", help="As Europe/Paris.")] = "UTC",
    count: Annotated[int, typer.Option("--count", min=1, max=50, metavar="COUNT", help="Times.")] = 5,
    gateway: GatewayOption = "",
    output: FormatOption = Format.TEXT,
) -> None:
    """The next times of a schedule, in UTC."""
    out = Output(output)
    asked = {"expression": expression, "timezone": timezone, "count": count}
    out.names(open_gateway(gateway).post("/api/v1/schedules/preview", asked)["times"])
