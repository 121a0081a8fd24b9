"""`metaros twin`: what robots are to be and what they say they are; tried first, applied, taken back."""

from __future__ import annotations

import sys
from collections.abc import Mapping
from pathlib import Path
from typing import Annotated, Any

import typer

from gateway.cli_template import add_templates
from metaros.cli.gateway_http import GatewayClient, GatewayOption, open_gateway, path_part
from metaros.cli.options import Format, FormatOption
from metaros.cli.output import Output, counted
from metaros.errors import ConfigError, UsageError
from metaros.inert import inert
from metaros.twin import ABSENT, Change, read

__all__ = [
    "Confirm",
    "DryRun",
    "Reason",
    "read_document",
    "register",
    "send",
    "show_change",
    "show_changes",
    "show_lines",
]

Robot = Annotated[str, typer.Argument(metavar="ROBOT", help="The robot's id.")]
SomeRobot = Annotated[str, typer.Argument(metavar="[ROBOT]", help="One robot; or leave it out and give -l.")]
Label = Annotated[
    str, typer.Option("--selector", "-l", metavar="TERMS", help="label=value, label!=value, label in (a, b), label.")
]
File = Annotated[str, typer.Argument(metavar="FILE|-|JSON", help="A JSON file, - for standard input, or {…} itself.")]
DryRun = Annotated[bool, typer.Option("--dry-run", help="Only say what would change.")]
Reason = Annotated[str, typer.Option("--reason", metavar="TEXT", help="Why, for the history.")]
Confirm = Annotated[
    float,
    typer.Option(
        "--confirm-s", min=5.0, max=3600.0, metavar="SECONDS", help="Robots go back without a confirmation in it."
    ),
]
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
        out.note(f"problem: {inert(found['problem'])}")
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
        who, why = inert(item["author"]), inert(item["reason"])
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


def read_document(source: str) -> dict[str, Any]:
    """A document of a file, of standard input, or as it is given; read as strictly as the gateway reads it."""
    if source.lstrip().startswith("{"):
        return read(source)
    if source == "-":
        return read(sys.stdin.buffer.read(1 << 20))
    try:
        return read(Path(source).read_bytes())
    except OSError as error:
        raise ConfigError(f"{source}: {error.strerror}") from None


def send(
    http: GatewayClient,
    method: str,
    path: str,
    body: Mapping[str, Any],
    *,
    query: Mapping[str, Any],
    expected: str = "",
) -> Any:
    """One change, with its options in the query; its answer."""
    import json

    headers = {"If-Match": f'"{expected}"'} if expected else {}
    asked = {key: str(value).lower() if isinstance(value, bool) else value for key, value in query.items()}
    with http.open(method, path, query={k: v for k, v in asked.items() if v != ""}, body=body, headers=headers) as got:
        return json.loads(b"".join(got.pieces()))


def show_change(out: Output, changed: dict[str, Any]) -> None:
    """What a change did, or would do, to one robot."""
    if out.json:
        out.objects(changed)
        return
    show_lines(out, changed["changes"] or changed["own_changes"])
    if changed["more"]:
        out.note(f"and {changed['more']} more")
    would = "would be" if changed["dry_run"] else "is" if changed["changed"] else "stays"
    out.note(f"{changed['robot']} {would} at revision {changed['revision']}")


def show_changes(out: Output, changed: dict[str, Any]) -> None:
    """The same for many."""
    if out.json:
        out.objects(changed)
        return
    for item in changed["results"]:
        if item["changed"]:
            out.line(f"{item['robot']}  revision {item['revision']}")
            show_lines(out, item["changes"] or item["own_changes"], indent="    ")
    would = "would change" if changed["dry_run"] else "changed"
    out.note(f"{would}: {counted(changed['changed'], 'robot')} of {changed['robots']}")


def show_lines(out: Output, changes: list[dict[str, Any]], *, indent: str = "") -> None:
    """Changes, one a line."""
    colours = {"+": "32", "-": "31", "~": "33"}
    for item in changes:
        change = Change(item["path"], item.get("old", ABSENT), item.get("new", ABSENT))
        text = inert(change.text)
        out.line(indent + out.style(text, colours[text[0]]))


def _row(item: dict[str, Any]) -> tuple[str, ...]:
    note = item["problem"] or item["message"] or item["code"]
    state = "in step" if item["in_step"] else item["state"] or "never reported"
    marks = " ".join(mark.partition("@")[0] for mark in item["templates"])
    return item["robot"], str(item["revision"]), str(item["applied"]), state, marks or "–", note or "–"


def _origin(found: dict[str, Any]) -> str:
    """Whose change it is, and why. The edition counts what changed nothing for the robot, as labels may."""
    who, why = inert(found["author"]), inert(found["reason"])
    said = f"revision {found['revision']}, edition {found['edition']}"
    return said + (f", by {who}" if who else "") + (f": {why}" if why else "")


def _standing(found: dict[str, Any]) -> str:
    said = found["reported"]
    if said is None:
        return "has never reported"
    if found["in_step"]:
        return f"in step, lives by revision {said['applied']}"
    message = inert(said["message"])
    return f"lives by revision {said['applied']}; {said['state']} {said['revision']}" + (
        f": {message}" if message else ""
    )


def _labels(labels: Mapping[str, str]) -> str:
    return inert(" ".join(f"{key}={value}" for key, value in sorted(labels.items()))) or "none"
