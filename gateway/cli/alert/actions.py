"""`metaros alert ack …`: what people do with one alert. Each prints how the alert stands then."""

from __future__ import annotations

from typing import Annotated, Any

import typer

from gateway.cli.alert.find import AlertId, alert_path
from gateway.cli.alert.view import state
from gateway.cli.time_span import span_s
from metaros.cli.shared.gateway_http import GatewayOption, open_gateway
from metaros.cli.shared.options import Format, FormatOption
from metaros.cli.shared.output import Output, sanitize
from metaros.errors import UsageError

__all__ = ["register"]

Text = Annotated[str, typer.Option("--text", "-t", metavar="TEXT", help="A remark that stays with the alert.")]


def register(noun: typer.Typer) -> None:
    """Add the verbs to the noun."""
    commands = (
        ("ack", _ack),
        ("unack", _unack),
        ("resolve", _resolve),
        ("assign", _assign),
        ("comment", _comment),
        ("normal", _normal),
        ("silence", _silence),
        ("clip", _clip),
    )
    for name, command in commands:
        noun.command(name)(command)


def _ack(alert: AlertId, text: Text = "", gateway: GatewayOption = "", output: FormatOption = Format.TEXT) -> None:
    """Take it: you see to it, and nobody is told of it again until it gets worse."""
    _act(alert, "acknowledge", {"text": text}, gateway, output)


def _unack(alert: AlertId, text: Text = "", gateway: GatewayOption = "", output: FormatOption = Format.TEXT) -> None:
    """Give it back: it is open again."""
    _act(alert, "unacknowledge", {"text": text}, gateway, output)


def _resolve(alert: AlertId, text: Text = "", gateway: GatewayOption = "", output: FormatOption = Format.TEXT) -> None:
    """It is over. Alerts resolve by themselves when what they found is; if it goes on, it opens again."""
    _act(alert, "resolve", {"text": text}, gateway, output)


def _assign(
    alert: AlertId,
    assignee: Annotated[str, typer.Argument(metavar="WHO", help="Who looks after it; nobody when left out.")] = "",
    gateway: GatewayOption = "",
    output: FormatOption = Format.TEXT,
) -> None:
    """Say who looks after it."""
    _act(alert, "assign", {"assignee": assignee}, gateway, output)


def _comment(
    alert: AlertId,
    text: Annotated[str, typer.Argument(metavar="TEXT", help="What to say.")],
    gateway: GatewayOption = "",
    output: FormatOption = Format.TEXT,
) -> None:
    """Say something about it."""
    _act(alert, "comments", {"text": text}, gateway, output)


def _normal(alert: AlertId, text: Text = "", gateway: GatewayOption = "", output: FormatOption = Format.TEXT) -> None:
    """This is normal: what learns takes it in, and is done with it. Fixed limits learn nothing, and it says so."""
    out = Output(output)
    http = open_gateway(gateway)
    done = http.post(alert_path(http, alert, "/normal"), {"text": text})
    if out.json:
        out.objects(done)
        return
    _show(out, done["alert"])
    for sentence in done["taught"]:
        out.line(f"  {sanitize(sentence)}")


def _silence(
    alert: Annotated[
        str, typer.Argument(metavar="ALERT", help="This one, by id or as ROBOT/CAUSE; else say --robot or --cause.")
    ] = "",
    for_: Annotated[str, typer.Option("--for", "-f", metavar="SPAN", help="How long: 30m, 12h, 2d.")] = "1h",
    reason: Annotated[str, typer.Option("--reason", metavar="TEXT", help="Why, for whoever wonders.")] = "",
    robot: Annotated[
        list[str] | None, typer.Option("--robot", "-r", metavar="GLOB", help="Of these robots; may be repeated.")
    ] = None,
    cause: Annotated[
        list[str] | None, typer.Option("--cause", metavar="GLOB", help="With these causes; may be repeated.")
    ] = None,
    up_to: Annotated[
        str, typer.Option("--up-to", metavar="info|warning|error", help="And only up to this severity.")
    ] = "error",
    gateway: GatewayOption = "",
    output: FormatOption = Format.TEXT,
) -> None:
    """Tell nobody for a while, of one alert's cause on its robot, or of whatever matches. Alerts still open."""
    out, for_s = Output(output), span_s(for_, "--for")
    if bool(alert) == bool(robot or cause):
        raise UsageError("say which: an ALERT, or --robot GLOB, --cause GLOB")
    http = open_gateway(gateway)
    if alert:
        made = http.post(alert_path(http, alert, "/silence"), {"for_s": for_s, "reason": reason})
    else:
        wanted = {"robots": robot or [], "causes": cause or [], "up_to": up_to, "for_s": for_s, "reason": reason}
        made = http.post("/api/v1/silences", wanted)
    if out.json:
        out.objects(made)
        return
    out.line(f"{sanitize(made['id'])}: silent until {made['until'][:19].replace('T', ' ')} UTC")
    out.note(f"end it: metaros alert unsilence {made['id']}")


def _clip(alert: AlertId, gateway: GatewayOption = "", output: FormatOption = Format.TEXT) -> None:
    """Save its evidence: what the robot's black box has of the half minute before it, and after."""
    out = Output(output)
    http = open_gateway(gateway)
    made = http.post(alert_path(http, alert, "/clip"), {})
    if out.json:
        out.objects(made)
        return
    out.line(sanitize(made["id"]))
    out.note(f"fetch it: metaros recording get {made['id']}")


def _act(alert: str, verb: str, body: dict[str, Any], gateway: str, output: Format) -> None:
    out = Output(output)
    http = open_gateway(gateway)
    done = http.post(alert_path(http, alert, f"/{verb}"), body)
    if out.json:
        out.objects(done)
    else:
        _show(out, done)


def _show(out: Output, alert: dict[str, Any]) -> None:
    who = f", assigned to {alert['assignee']}" if alert["assignee"] else ""
    out.line(sanitize(f"{alert['id']}: {state(alert)}{who}"))
