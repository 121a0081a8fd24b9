"""`metaros twin`: what robots are to be and what they say they are; tried first, applied, taken back."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Annotated, Any

import typer

from gateway.cli.template import add_templates
from gateway.cli.twin_change import Confirm, DryRun, Reason, read_document, send, show_change, show_changes, show_lines
from metaros.cli.shared.gateway_http import GatewayOption, open_gateway, path_part
from metaros.cli.shared.options import Format, FormatOption
from metaros.cli.shared.output import Output
from metaros.errors import UsageError
from metaros.sanitize import sanitize

__all__ = ["register"]

Robot = Annotated[str, typer.Argument(metavar="ROBOT", help="The robot's id.")]
SomeRobot = Annotated[str, typer.Argument(metavar="[ROBOT]", help="One robot; or leave it out and give -l.")]
Label = Annotated[
    str, typer.Option("--selector", "-l", metavar="TERMS", help="label=value, label!=value, label in (a, b), label.")
]
File = Annotated[str, typer.Argument(metavar="FILE|-|JSON", help="A JSON file, - for standard input, or {…} itself.")]
Expected = Annotated[
    str, typer.Option("--if-revision", metavar="N", help="Only if the twin is still at this revision, as 7 or 7.12.")
]


def register(app: typer.Typer) -> None:
    """Add the noun to `metaros`."""
    noun = typer.Typer(no_args_is_help=True, help="What robots are to be, and what they say they are.")
    noun.command("show")(_show)
    noun.command("set")(_set)
    noun.command("patch")(_patch)
    noun.command("diff")(_diff)
    noun.command("history")(_history)
    noun.command("revert")(_revert)
    noun.command("retry")(_retry)
    add_templates(noun)
    app.add_typer(noun, name="twin")


def _show(
    robot: SomeRobot = "", selector: Label = "", gateway: GatewayOption = "", output: FormatOption = Format.TEXT
) -> None:
    """One robot's twin; without a robot a line for each that the selector names."""
    out, http = Output(output), open_gateway(gateway)
    if not robot:
        found = http.get("/api/v1/twins", selector=selector)["twins"]
        if out.json:
            out.objects(found)
            return
        names = ("Robot", "Revision", "Lives by", "State", "Templates", "Note")
        out.table(names, [_row(item) for item in found], empty="no robots", right=(1, 2))
        return
    found = http.get(f"/api/v1/robots/{path_part(robot)}/twin")
    if out.json:
        out.objects(found)
        return
    out.note(f"desired: {_origin(found)}")
    out.note(f"templates: {' '.join(found['templates']) or 'none'}; labels: {_labels(found['labels'])}")
    out.note(f"robot: {_standing(found)}")
    if found["problem"]:
        out.note(f"problem: {sanitize(found['problem'])}")
    out.objects(found["desired"])


def _set(
    robot: Robot,
    file: File,
    dry_run: DryRun = False,
    reason: Reason = "",
    confirm_s: Confirm = 60.0,
    if_revision: Expected = "",
    gateway: GatewayOption = "",
    output: FormatOption = Format.TEXT,
) -> None:
    """Give a robot another own document."""
    path = f"/api/v1/robots/{path_part(robot)}/twin"
    query = {"dry_run": dry_run, "reason": reason, "confirm_within_s": confirm_s}
    changed = send(open_gateway(gateway), "PUT", path, read_document(file), query=query, expected=if_revision)
    show_change(Output(output), changed)


def _patch(
    robot_or_file: Annotated[str, typer.Argument(metavar="[ROBOT]", help="One robot; or leave it out and give -l.")],
    file: Annotated[str, typer.Argument(metavar="FILE|-|JSON", help="A JSON merge patch: a file, - or {…}.")] = "",
    selector: Label = "",
    dry_run: DryRun = False,
    reason: Reason = "",
    confirm_s: Confirm = 60.0,
    if_revision: Expected = "",
    gateway: GatewayOption = "",
    output: FormatOption = Format.TEXT,
) -> None:
    """Change parts of a robot's own document, or of those of every robot that -l names: of all, or of none."""
    query = {"dry_run": dry_run, "reason": reason, "confirm_within_s": confirm_s}
    out, http = Output(output), open_gateway(gateway)
    if file:
        if selector:
            raise UsageError("say either a robot, or -l")
        path = f"/api/v1/robots/{path_part(robot_or_file)}/twin"
        show_change(out, send(http, "PATCH", path, read_document(file), query=query, expected=if_revision))
        return
    if not selector or if_revision:
        raise UsageError("say a robot and a patch, or a patch and -l; --if-revision is for one robot")
    document = read_document(robot_or_file)
    show_changes(out, send(http, "PATCH", "/api/v1/twins", document, query={**query, "selector": selector}))


def _diff(
    robot: Robot,
    file: Annotated[str, typer.Argument(metavar="[FILE|-|JSON]", help="What would change with it.")] = "",
    gateway: GatewayOption = "",
    output: FormatOption = Format.TEXT,
) -> None:
    """From what the robot lives by to what is desired; with a file: what `set` would change."""
    out, http, path = Output(output), open_gateway(gateway), f"/api/v1/robots/{path_part(robot)}/twin"
    if file:
        show_change(out, send(http, "PUT", path, read_document(file), query={"dry_run": True}))
        return
    found = http.get(path)
    if out.json:
        out.objects(found["behind"])
        return
    show_lines(out, found["behind"])
    if not found["behind"]:
        out.note("it lives by what is desired" if found["in_step"] else "what it lives by is not kept here")


def _history(
    robot: Robot,
    limit: Annotated[int, typer.Option("--limit", "-n", min=1, max=100, metavar="COUNT", help="The newest.")] = 20,
    gateway: GatewayOption = "",
    output: FormatOption = Format.TEXT,
) -> None:
    """Who changed what, when and why; the newest first."""
    out = Output(output)
    found = open_gateway(gateway).get(f"/api/v1/robots/{path_part(robot)}/twin/history", limit=limit)["entries"]
    if out.json:
        out.objects(found)
        return
    for item in found:
        who, why = sanitize(item["author"]), sanitize(item["reason"])
        out.line(f"{item['revision']}.{item['edition']}  {item['at'][:19]}Z  {who}  {why}")
        show_lines(out, item["changes"], indent="    ")


def _revert(
    robot: Robot,
    revision: Annotated[int, typer.Argument(min=0, metavar="REVISION", help="Of `metaros twin history`; 0: nothing.")],
    dry_run: DryRun = False,
    reason: Reason = "",
    confirm_s: Confirm = 60.0,
    if_revision: Expected = "",
    gateway: GatewayOption = "",
    output: FormatOption = Format.TEXT,
) -> None:
    """Give a robot its own document of an earlier revision; templates stay as they are."""
    path = f"/api/v1/robots/{path_part(robot)}/twin/revert"
    query = {"dry_run": dry_run, "reason": reason, "confirm_within_s": confirm_s}
    body = {"revision": revision}
    show_change(Output(output), send(open_gateway(gateway), "POST", path, body, query=query, expected=if_revision))


def _retry(robot: Robot, reason: Reason = "", gateway: GatewayOption = "", output: FormatOption = Format.TEXT) -> None:
    """Send the same document under a new revision: to a robot that refused it or went back."""
    path = f"/api/v1/robots/{path_part(robot)}/twin/retry"
    show_change(Output(output), send(open_gateway(gateway), "POST", path, {}, query={"reason": reason}))


def _row(item: dict[str, Any]) -> tuple[str, ...]:
    note = item["problem"] or item["message"] or item["code"]
    state = "in step" if item["in_step"] else item["state"] or "never reported"
    marks = " ".join(mark.partition("@")[0] for mark in item["templates"])
    return item["robot"], str(item["revision"]), str(item["applied"]), state, marks or "–", note or "–"


def _origin(found: dict[str, Any]) -> str:
    """Whose change it is, and why. The edition counts what changed nothing for the robot, as labels may."""
    who, why = sanitize(found["author"]), sanitize(found["reason"])
    said = f"revision {found['revision']}, edition {found['edition']}"
    return said + (f", by {who}" if who else "") + (f": {why}" if why else "")


def _standing(found: dict[str, Any]) -> str:
    said = found["reported"]
    if said is None:
        return "has never reported"
    if found["in_step"]:
        return f"in step, lives by revision {said['applied']}"
    message = sanitize(said["message"])
    return f"lives by revision {said['applied']}; {said['state']} {said['revision']}" + (
        f": {message}" if message else ""
    )


def _labels(labels: Mapping[str, str]) -> str:
    return sanitize(" ".join(f"{key}={value}" for key, value in sorted(labels.items()))) or "none"
