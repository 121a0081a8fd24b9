"""`metaros robot`: the robots of the fleet: enrolment tokens, identities, revocation."""

from __future__ import annotations

from typing import Annotated, Any

import typer

from metaros.cli.shared.gateway_http import GatewayOption, open_gateway, path_part
from metaros.cli.shared.options import Format, FormatOption
from metaros.cli.shared.output import Output
from metaros.cli.shared.watch import WatchOption, watch
from metaros.errors import UsageError
from metaros.sanitize import sanitize

__all__ = ["register"]

Ttl = Annotated[float, typer.Option("--ttl-min", min=1.0, max=1440.0, metavar="MIN", help="How long it is good.")]
RobotId = Annotated[
    str, typer.Option("--robot", metavar="ROBOT", help="Only for this robot; needed to enrol one again.")
]


def register(app: typer.Typer) -> None:
    """Add the noun to `metaros`."""
    noun = typer.Typer(no_args_is_help=True, help="Robots of the fleet: who they are, and how they come to belong.")
    for name, command in _VERBS:
        noun.command(name)(command)
    app.add_typer(noun, name="robot")


def _token(
    robot: RobotId = "", ttl_min: Ttl = 60.0, gateway: GatewayOption = "", output: FormatOption = Format.TEXT
) -> None:
    """Make a token that enrols one robot once, and print the command to run on that robot."""
    out = Output(output)
    made = open_gateway(gateway).post("/api/v1/enrolment-tokens", {"robot": robot, "ttl_s": ttl_min * 60.0})
    if out.json:
        out.objects(made)
        return
    out.line(sanitize(made["command"]))
    out.note(f"run it on the robot before {sanitize(made['expires'][:16])}Z; it works once and is not shown again")


def _list(
    selector: Annotated[
        str, typer.Option("--selector", "-l", metavar="TERMS", help="Only those named: label=value, label in (a, b).")
    ] = "",
    again: WatchOption = False,
    gateway: GatewayOption = "",
    output: FormatOption = Format.TEXT,
) -> None:
    """The robots that ever connected: which are there now, and who drives them."""
    out, http = Output(output), open_gateway(gateway)

    def find() -> Any:
        return list(http.pages("/api/v1/robots", "robots", selector=selector or None))

    def show(found: Any) -> None:
        out.listing(("Robot", "State", "Since (UTC)", "Labels", "Driven by", "Agent"), found, _robot, empty="no robots")

    watch(out, find, show, again=again)


def _robot(item: dict[str, Any]) -> tuple[str, ...]:
    labels = ",".join(f"{key}={value}" for key, value in sorted(item["labels"].items()))
    since, lease = item["since"][:16].replace("T", " "), item["lease"]
    driver = lease["holder"] if lease is not None else "–"
    return item["id"], item["state"], since, labels or "–", driver, item["agent_version"]


def _identities(gateway: GatewayOption = "", output: FormatOption = Format.TEXT) -> None:
    """The identities there are, and what looks wrong with them."""
    out = Output(output)
    found = open_gateway(gateway).get("/api/v1/identities")["identities"]
    names = ("Robot", "State", "Enrolled", "Certificate ends", "Note")
    out.listing(names, found, _row, empty="no robot is enrolled")


def _row(item: dict[str, Any]) -> tuple[str, ...]:
    good = [one["not_after"] for one in item["certificates"] if not one["revoked"]]
    note = item["alarm"] or item["reason"]
    return item["robot"], item["state"], item["enrolled"][:10], max(good)[:16] if good else "–", note or "–"


def _label(
    robot: Annotated[str, typer.Argument(metavar="ROBOT", help="The robot's id.")],
    labels: Annotated[
        list[str] | None, typer.Argument(metavar="[LABEL=VALUE]...", help="To give; LABEL- takes one away.")
    ] = None,
    dry_run: Annotated[bool, typer.Option("--dry-run", help="Only say what templates would change with it.")] = False,
    reason: Annotated[str, typer.Option("--reason", metavar="TEXT", help="Why, for the history.")] = "",
    gateway: GatewayOption = "",
    output: FormatOption = Format.TEXT,
) -> None:
    """Give a robot labels, over those that it says itself; without any, show them. Templates follow labels."""
    from gateway.cli.twin_change import send, show_change

    out, http, path = Output(output), open_gateway(gateway), f"/api/v1/robots/{path_part(robot)}"
    if labels:
        wanted = dict(_one_label(text) for text in labels)
        query = {"dry_run": dry_run, "reason": reason}
        show_change(out, send(http, "PATCH", f"{path}/labels", {"labels": wanted}, query=query))
        return
    found = http.get(f"{path}/twin")["labels"]
    if out.json:
        out.objects(found)
        return
    for key, value in sorted(found.items()):
        out.line(sanitize(f"{key}={value}"))


def _one_label(text: str) -> tuple[str, str | None]:
    key, sign, value = text.partition("=")
    if sign and key and value:
        return key, value
    if not sign and text.endswith("-") and len(text) > 1:
        return text[:-1], None
    raise UsageError(f"{text!r}: say LABEL=VALUE, or LABEL- to take one away")


def _revoke(
    robot: Annotated[str, typer.Argument(metavar="ROBOT", help="The robot, as `metaros robot identities` shows it.")],
    reason: Annotated[str, typer.Option("--reason", metavar="TEXT", help="Why, for whoever looks later.")] = "",
    gateway: GatewayOption = "",
) -> None:
    """End a robot's identity: its link is cut within seconds, and only a token for this robot brings it back."""
    open_gateway(gateway).post(f"/api/v1/robots/{path_part(robot)}/revoke", {"reason": reason})


_VERBS = (
    ("list", _list),
    ("token", _token),
    ("identities", _identities),
    ("label", _label),
    ("revoke", _revoke),
)
