"""`metaros command`: have robots do something, see what became of it, take it back."""

from __future__ import annotations

import json
import math
import re
import secrets
from collections.abc import Mapping, Sequence
from typing import Annotated, Any

import typer

from gateway.cli.name_values import pairs
from gateway.errors import GatewayError
from metaros.cli.shared.gateway_http import GatewayClient, GatewayOption, open_gateway, path_part
from metaros.cli.shared.options import Format, FormatOption
from metaros.cli.shared.output import Output, counted
from metaros.cli.shared.watch import WatchOption, watch
from metaros.errors import UsageError
from metaros.sanitize import sanitize

__all__ = ["register"]

WAIT_AT_ONCE_S = 20.0
OPEN = ("issued", "delivered", "running")
_SPAN = re.compile(r"(\d{1,9}(?:\.\d{1,6})?)(s|m|h|d)?")
_UNIT_S = {"s": 1.0, "m": 60.0, "h": 3600.0, "d": 86_400.0, None: 1.0}

Id = Annotated[str, typer.Argument(metavar="ID", help="The command, as `metaros command list` shows it.")]
Kind = Annotated[str, typer.Argument(metavar="KIND", help="As publish, call_service, node_verb, read_log.")]
Fields = Annotated[
    list[str] | None, typer.Argument(metavar="FIELD=VALUE…", help="What the kind asks for; values as JSON, else text.")
]
RobotId = Annotated[str, typer.Option("--robot", "-r", metavar="ID", help="To this robot.")]
Selector = Annotated[
    str, typer.Option("--selector", "-l", metavar="TERMS", help="To each robot named: label=value, label in (a, b).")
]
Durable = Annotated[bool, typer.Option("--durable", help="It may come later: deliver it when the robot is there.")]
Expires = Annotated[str, typer.Option("--expires", metavar="SPAN", help="Of a durable one: until when; 30m, 12h, 2d.")]
Timeout = Annotated[float, typer.Option("--timeout", min=0.1, max=120.0, metavar="SECONDS", help="Its own time there.")]
Wait = Annotated[float, typer.Option("--wait", min=0.0, metavar="SECONDS", help="Follow a durable one for so long.")]
Key = Annotated[
    str, typer.Option("--idempotency-key", metavar="TEXT", help="The same one again is the same command; default: new.")
]
DryRun = Annotated[bool, typer.Option("--dry-run", help="Only say which robots would get it.")]


def register(app: typer.Typer) -> None:
    """Add the noun to `metaros`."""
    noun = typer.Typer(no_args_is_help=True, help="Commands to robots: send, follow, look back, take back.")
    for name, command in (("send", _send), ("list", _list), ("show", _show), ("cancel", _cancel)):
        noun.command(name)(command)
    app.add_typer(noun, name="command")


def _send(
    kind: Kind,
    fields: Fields = None,
    robot: RobotId = "",
    selector: Selector = "",
    durable: Durable = False,
    expires: Expires = "1h",
    timeout: Timeout = 10.0,
    wait: Wait = 0.0,
    idempotency_key: Key = "",
    dry_run: DryRun = False,
    gateway: GatewayOption = "",
    output: FormatOption = Format.TEXT,
) -> None:
    """Send a command to one robot, or one to each robot of a selector. Ends with 1 when one failed."""
    if bool(robot) == bool(selector):
        raise UsageError("say --robot ID, or -l TERMS for each robot that they name")
    out, client = Output(output), open_gateway(gateway)
    body: dict[str, Any] = {
        "kind": kind,
        "request": pairs(fields or [], shape="FIELD=VALUE", example="bytes_per_s=50000"),
        "timeout_s": timeout,
    }
    if durable:
        body |= {"durable": True, "expires_s": _seconds(expires)}
    # The named robot by a selector too: so a dry run is the gateway's word, with one path for all.
    body |= {"selector": selector or f"robot={robot}", "dry_run": dry_run}
    headers = {"Idempotency-Key": idempotency_key or secrets.token_hex(16)}
    with client.open("POST", "/api/v1/commands", body=body, headers=headers) as answer:
        sent = json.loads(b"".join(answer.pieces()))
    if not sent["robots"]:
        raise GatewayError(f"no robot {robot!r} is known" if robot else f"no robot is {selector}")
    commands = sent["commands"] if not wait else [_follow(client, item, wait) for item in sent["commands"]]
    _report(out, {**sent, "commands": commands}, dry_run=dry_run)
    failed = [item for item in commands if item["state"] in ("failed", "expired")]
    if failed or sent["refused"]:
        raise GatewayError(f"{counted(len(failed) + len(sent['refused']), 'robot')} did not do it")


def _list(
    robot: RobotId = "",
    state: Annotated[str, typer.Option("--state", metavar="STATE", help="Only those in it, as issued or failed.")] = "",
    issuer: Annotated[str, typer.Option("--issuer", metavar="NAME", help="Only those of this user or key.")] = "",
    limit: Annotated[int, typer.Option("--limit", "-n", min=1, max=1000, metavar="COUNT", help="The newest.")] = 50,
    again: WatchOption = False,
    gateway: GatewayOption = "",
    output: FormatOption = Format.TEXT,
) -> None:
    """The commands of a gateway, the newest first."""
    out, http = Output(output), open_gateway(gateway)
    query = {"robot": robot or None, "state": state or None, "issuer": issuer or None, "limit": limit}

    def show(found: Any) -> None:
        if out.json:
            out.objects(found)
        else:
            _table(out, found)

    watch(out, lambda: http.get("/api/v1/commands", **query)["commands"], show, again=again)


def _show(command_id: Id, gateway: GatewayOption = "", output: FormatOption = Format.TEXT) -> None:
    """One command: what was asked, how far it is, what came back."""
    out = Output(output)
    found = open_gateway(gateway).get(f"/api/v1/commands/{path_part(command_id)}")
    if out.json:
        out.objects(found)
        return
    for name, value in found.items():
        if value not in (None, ""):
            text = value if isinstance(value, str) else json.dumps(value, ensure_ascii=False)
            out.line(f"{name.replace('_', ' '):16} {sanitize(text)}")


def _cancel(command_id: Id, gateway: GatewayOption = "") -> None:
    """Take back a durable command that has not left for its robot."""
    open_gateway(gateway).delete(f"/api/v1/commands/{path_part(command_id)}")


def _follow(client: GatewayClient, item: dict[str, Any], wait_s: float) -> dict[str, Any]:
    """The command at its end, or after `wait_s`."""
    for _ in range(math.ceil(wait_s / WAIT_AT_ONCE_S)):
        if item["state"] not in OPEN:
            break
        item = client.get(f"/api/v1/commands/{path_part(item['id'])}", wait_s=min(wait_s, WAIT_AT_ONCE_S))
        wait_s -= WAIT_AT_ONCE_S
    return item


def _report(out: Output, sent: Mapping[str, Any], *, dry_run: bool) -> None:
    if out.json:
        out.objects(dict(sent))
        return
    if dry_run:
        for robot in sent["robots"]:
            out.line(robot)
        return
    _table(out, sent["commands"])
    for robot, why in sent["refused"].items():
        out.note(f"{robot}: {why['code']}: {sanitize(why['message'])}")


def _table(out: Output, found: Sequence[Mapping[str, Any]]) -> None:
    names = ("Id", "Robot", "Kind", "State", "Issued (UTC)", "By", "Note")
    out.table(names, [_row(item) for item in found], empty="no commands")


def _row(item: Mapping[str, Any]) -> Sequence[object]:
    result = "" if item["result"] is None else json.dumps(item["result"], ensure_ascii=False)
    note = f"{item['code']}: {item['message']}" if item["code"] else result
    moment = f"{item['issued'][5:10]} {item['issued'][11:19]}"
    short = note if len(note) <= 60 else f"{note[:59]}…"
    return item["id"], item["robot"], item["kind"], item["state"], moment, sanitize(item["issued_by"]), sanitize(short)


def _seconds(text: str) -> float:
    match = _SPAN.fullmatch(text)
    if match is None or not float(match[1]):
        raise UsageError(f"--expires {text}: not a span like 30m, 12h or 2d")
    return float(match[1]) * _UNIT_S[match[2]]
