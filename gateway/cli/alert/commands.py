"""`metaros alert`: what is wrong with the fleet's robots, why, and what people do about it."""

from __future__ import annotations

import contextlib
from collections.abc import Iterator
from typing import Annotated, Any

import typer

from gateway.cli.alert.actions import register as register_actions
from gateway.cli.alert.backtest import register as register_backtest
from gateway.cli.alert.checks import register as register_rules
from gateway.cli.alert.find import AlertId, alert_path
from gateway.cli.alert.view import HEADINGS, show_alert, show_change, table_row
from gateway.domain.automation.event import like
from metaros.cli.shared.gateway_http import GatewayClient, GatewayOption, events, open_gateway
from metaros.cli.shared.options import Format, FormatOption
from metaros.cli.shared.output import Output, counted
from metaros.cli.shared.watch import WatchOption, watch
from metaros.clock import SystemClock
from metaros.errors import PeerError

__all__ = ["register"]

PAGE = 200
UNRESOLVED = ("open", "acknowledged")
EVENT_KINDS = "alert.*"
EVENT_TYPE = "metaros.alert."

Robots = Annotated[
    list[str] | None, typer.Option("--robot", "-r", metavar="ROBOT", help="Only this robot's; may be repeated.")
]
Severities = Annotated[
    list[str] | None, typer.Option("--severity", metavar="info|warning|error", help="Only these; may be repeated.")
]
Causes = Annotated[
    list[str] | None, typer.Option("--cause", metavar="GLOB", help="Only these, as heat or rate:*; may be repeated.")
]


def register(app: typer.Typer) -> None:
    """Add the noun to `metaros`."""
    noun = typer.Typer(no_args_is_help=True, help="What is wrong with robots, why, and what is done about it.")
    for name, command in (("list", _list), ("show", _show), ("watch", _watch)):
        noun.command(name)(command)
    register_actions(noun)
    register_rules(noun)
    register_backtest(noun)
    app.add_typer(noun, name="alert")


def _list(
    robot: Robots = None,
    severity: Severities = None,
    cause: Causes = None,
    text: Annotated[str, typer.Option("--text", "-t", metavar="TEXT", help="In title, reason or series.")] = "",
    every: Annotated[bool, typer.Option("--all", "-a", help="Those that are resolved, too.")] = False,
    quiet: Annotated[bool, typer.Option("--quiet", "-q", help="Only those that nobody is told of.")] = False,
    start: Annotated[str, typer.Option("--start", "-s", metavar="TIME", help="Not over before; RFC 3339, -2h.")] = "",
    end: Annotated[str, typer.Option("--end", "-e", metavar="TIME", help="Begun before; RFC 3339, -2h.")] = "",
    limit: Annotated[int, typer.Option("--limit", "-n", min=1, max=10_000, metavar="COUNT", help="The newest.")] = 50,
    again: WatchOption = False,
    gateway: GatewayOption = "",
    output: FormatOption = Format.TEXT,
) -> None:
    """The alerts of a gateway that are not resolved, the newest first."""
    out, http = Output(output), open_gateway(gateway)
    query = {
        "state": None if every else UNRESOLVED,
        "robot": robot,
        "severity": severity,
        "cause": cause,
        "q": text or None,
        "quiet": "true" if quiet else None,
        "from": start or None,
        "until": end or None,
    }

    def show(found: list[Any]) -> None:
        out.listing(HEADINGS, found, table_row, empty="nothing is wrong" if not every else "no alerts", right=(6,))
        if out.tty and not out.json and len(found) == limit:
            out.note(f"these are the newest {limit}; more with --limit")

    watch(out, lambda: list(_pages(http, query, limit)), show, again=again)


def _pages(http: GatewayClient, query: dict[str, Any], limit: int) -> Iterator[Any]:
    """So many alerts, as many pages as it takes."""
    cursor = None
    while limit > 0:
        page = http.get("/api/v1/alerts", **query, limit=min(limit, PAGE), before=cursor)
        yield from page["alerts"]
        limit -= len(page["alerts"])
        cursor = page["next"]
        if cursor is None:
            return


def _show(alert: AlertId, gateway: GatewayOption = "", output: FormatOption = Format.TEXT) -> None:
    """One alert: what was measured and expected, its findings, what people said, and its page."""
    out, http = Output(output), open_gateway(gateway)
    found = http.get(alert_path(http, alert))
    if out.json:
        out.objects(found)
        return
    show_alert(out, found, now_ns=SystemClock().wall_ns(), origin=http.url)


def _watch(
    robot: Robots = None,
    cause: Causes = None,
    gateway: GatewayOption = "",
    output: FormatOption = Format.TEXT,
) -> None:
    """Alerts as they open, change and are resolved, a line each, until Ctrl-C."""
    out, http = Output(output), open_gateway(gateway)
    query = {"kind": EVENT_KINDS, "robot": ",".join(robot or ()) or None}
    with (
        contextlib.suppress(KeyboardInterrupt),
        http.open("GET", "/api/v1/events", query=query, headers={"Accept": "text/event-stream"}) as answer,
    ):
        out.note("waiting for alerts; Ctrl-C ends it")
        for name, event in events(answer):
            if name == "lost":
                out.note(f"{counted(int(event['count']), 'event')} not kept any more")
            elif not cause or any(like(str(event["data"].get("cause", "")), glob) for glob in cause):
                _report(out, event)
        raise PeerError("the gateway ended the stream of alerts\nrun it again: it goes on with what happens now")


def _report(out: Output, event: dict[str, Any]) -> None:
    if out.json:
        out.object_line(event)
    else:
        show_change(out, str(event["data"].get("what") or event["type"].removeprefix(EVENT_TYPE)), event)
