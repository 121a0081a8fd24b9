"""`metaros node … --robot R | -l TERMS`: the nodes that robots' supervisors run, by a gateway.

The noun itself, with what it says of the ROS graph of this machine, is `metaros.cli.node`; it finds this module by the
entry point `node` of the group `metaros.cli.remote`.
"""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from typing import Annotated, Any

import typer

from gateway.cli.name_values import pairs
from gateway.cli.node.values import add_values
from gateway.cli.twin_change import Confirm, DryRun, Reason, read_document, send, show_change, show_changes
from gateway.errors import GatewayError
from metaros.cli.shared.gateway_http import GatewayClient, GatewayOption, events, open_gateway, path_part
from metaros.cli.shared.options import Format, FormatOption
from metaros.cli.shared.output import Output, counted
from metaros.cli.shared.watch import watch
from metaros.errors import UsageError
from metaros.sanitize import sanitize

__all__ = ["list_nodes", "register", "show_node"]

NodeName = Annotated[str, typer.Argument(metavar="NODE", help="Its name in the robot's table, as `lidar`.")]
OneRobot = Annotated[str, typer.Option("--robot", "-r", metavar="ROBOT", help="Of this robot.")]
Selector = Annotated[
    str, typer.Option("--selector", "-l", metavar="TERMS", help="Of each robot named: label=value, label in (a, b).")
]
TAIL_OVER = "tail_over"  # the gateway ends a long tail, which goes on with its cursor


def register(noun: typer.Typer) -> None:
    """Add the remote verbs to `metaros node`."""
    for verb, text in (
        ("start", "Run it from now on; a robot that is offline does it when it is back."),
        ("stop", "End it until it is started again; a robot that is offline does it when it is back."),
        ("restart", "End it and start it again now."),
        ("retry", "End its quarantine now."),
    ):
        noun.command(verb, help=text)(_verb(verb))
    noun.command("signal")(_signal)
    noun.command("set")(_set)
    noun.command("put")(_put)
    noun.command("remove")(_remove)
    noun.command("log")(_log)
    noun.command("crashes")(_crashes)
    add_values(noun)


def list_nodes(out: Output, *, robot: str, selector: str, state: str, gateway: str, again: bool) -> None:
    """`metaros node list` of one robot, or of each that the selector names; `again`: until Ctrl-C."""
    http = open_gateway(gateway)
    more = False

    def find() -> Any:
        nonlocal more
        if robot:
            nodes = http.get(f"/api/v1/robots/{path_part(robot)}/nodes")["nodes"]
            return [node for node in nodes if state in ("", node["state"])]
        found = http.get("/api/v1/nodes", selector=selector, state=state)
        more = found["more"]
        return found["nodes"]

    def show(nodes: Any) -> None:
        columns = ("Robot", "Node", "State", "Pid", "Restarts", "Since (UTC)", "Version", "Note")
        out.listing(columns, nodes, _row, empty="no nodes", right=(3, 4))
        if more and not out.json:
            out.note("there are further ones: name fewer robots, or a --state")

    watch(out, find, show, again=again)


def show_node(out: Output, name: str, *, robot: str, gateway: str) -> None:
    """`metaros node info` of a robot's node."""
    node = open_gateway(gateway).get(_path(robot, name))
    if out.json:
        out.objects(node)
        return
    out.line(out.style(f"{node['robot']} {node['name']}", "1") + f"  {node['ros_name']}")
    out.line(f"  {'wanted':10} {node['wanted']}")
    for key, value in (node["reported"] or {}).items():
        if value not in (None, "", [], False):
            text = value if isinstance(value, str) else json.dumps(value, ensure_ascii=False)
            out.line(f"  {key.replace('_', ' '):10} {sanitize(text)}")
    if node["holder"]:
        out.line(f"  {'lease':10} {node['holder']} runs it")
    for item in node["differs"]:
        out.note(f"{item['what']}: {item['desired']} is wanted, it is {item['reported']}: {sanitize(item['why'])}")
    if not node["online"]:
        out.note(f"the robot is offline; this is what it said at {node['reported_at']}")


def _verb(verb: str) -> Any:
    def act(
        node: NodeName,
        robot: OneRobot = "",
        selector: Selector = "",
        dry_run: DryRun = False,
        reason: Reason = "",
        gateway: GatewayOption = "",
        output: FormatOption = Format.TEXT,
    ) -> None:
        _act(Output(output), gateway, node, verb, robot, selector, dry_run=dry_run, reason=reason)

    return act


def _signal(
    node: NodeName,
    number: Annotated[int, typer.Argument(min=1, max=64, metavar="NUMBER", help="As 1 for SIGHUP, 10 for SIGUSR1.")],
    robot: OneRobot = "",
    selector: Selector = "",
    dry_run: DryRun = False,
    reason: Reason = "",
    gateway: GatewayOption = "",
    output: FormatOption = Format.TEXT,
) -> None:
    """Send its process a signal."""
    _act(Output(output), gateway, node, "signal", robot, selector, dry_run=dry_run, reason=reason, signal=number)


def _act(
    out: Output,
    gateway: str,
    node: str,
    verb: str,
    robot: str,
    selector: str,
    *,
    dry_run: bool,
    reason: str,
    signal: int = 0,
) -> None:
    """A verb; ends with 1 where it failed at some robot."""
    _one_of(robot, selector)
    # The one robot by a selector too: its failure is told like those of a group.
    body = {"selector": selector or f"robot={robot}", "node": node, **({"signal": signal} if signal else {})}
    query = {"dry_run": dry_run, "reason": reason}
    found = send(open_gateway(gateway), "POST", f"/api/v1/nodes/{verb}", body, query=query)
    if out.json:
        out.objects(found)
    else:
        for item in found["results"]:
            note = f": {sanitize(item['message'])}" if item["message"] else ""
            twin = f" (revision {item['revision']})" if item["changed"] else ""
            would = "would be " if dry_run else ""
            out.line(f"{item['robot']}  {verb} {node}: {would}{item['outcome']}{twin}{note}")
    failed = sum(1 for item in found["results"] if item["outcome"] == "failed")
    if failed:
        raise GatewayError(f"{counted(failed, 'robot')} did not do it")


def _set(
    node: NodeName,
    fields: Annotated[list[str], typer.Argument(metavar="KEY=VALUE…", help="As nice=5, critical=true, version=1.3.0.")],
    robot: OneRobot = "",
    selector: Selector = "",
    dry_run: DryRun = False,
    reason: Reason = "",
    confirm_s: Confirm = 60.0,
    gateway: GatewayOption = "",
    output: FormatOption = Format.TEXT,
) -> None:
    """Change keys of its row in the twin; null gives one back to the templates. Of all robots named, or of none."""
    _one_of(robot, selector)
    out, http = Output(output), open_gateway(gateway)
    query = {"dry_run": dry_run, "reason": reason, "confirm_within_s": confirm_s}
    patch = pairs(fields, shape="KEY=VALUE", example="nice=5")
    if robot:
        show_change(out, send(http, "PATCH", _path(robot, node), patch, query=query))
    else:
        path = f"/api/v1/nodes/{path_part(node)}"
        show_changes(out, send(http, "PATCH", path, patch, query={**query, "selector": selector}))


def _put(
    node: NodeName,
    row: Annotated[str, typer.Argument(metavar="FILE|-|JSON", help='Its row, as {"bundle": "x", "version": "1.0"}.')],
    robot: OneRobot,
    dry_run: DryRun = False,
    reason: Reason = "",
    confirm_s: Confirm = 60.0,
    gateway: GatewayOption = "",
    output: FormatOption = Format.TEXT,
) -> None:
    """Give a robot this node, or this row of it, whatever templates say."""
    query = {"dry_run": dry_run, "reason": reason, "confirm_within_s": confirm_s}
    changed = send(open_gateway(gateway), "PUT", _path(robot, node), read_document(row), query=query)
    show_change(Output(output), changed)


def _remove(
    node: NodeName,
    robot: OneRobot,
    dry_run: DryRun = False,
    reason: Reason = "",
    confirm_s: Confirm = 60.0,
    gateway: GatewayOption = "",
    output: FormatOption = Format.TEXT,
) -> None:
    """Take a node away from a robot, also where a template brings it."""
    query = {"dry_run": dry_run, "reason": reason, "confirm_within_s": confirm_s}
    show_change(Output(output), send(open_gateway(gateway), "DELETE", _path(robot, node), {}, query=query))


def _log(
    node: NodeName,
    robot: OneRobot,
    follow: Annotated[bool, typer.Option("--follow", "-f", help="Go on with what comes.")] = False,
    query: Annotated[str, typer.Option("--query", "-q", metavar="TEXT", help="Only lines that hold this text.")] = "",
    size: Annotated[
        int, typer.Option("--bytes", min=256, max=262_144, metavar="COUNT", help="How much of its end.")
    ] = 65_536,
    gateway: GatewayOption = "",
    output: FormatOption = Format.TEXT,
) -> None:
    """The newest lines of a node's log, from the robot's disk."""
    out, http, path = Output(output), open_gateway(gateway), f"{_path(robot, node)}/log"
    if follow:
        _follow(out, http, f"{path}/tail", query)
        return
    page = http.get(path, query=query, max_bytes=size)
    if out.json:
        out.objects(page)
        return
    _lines(out, page["lines"])


def _follow(out: Output, http: GatewayClient, path: str, query: str) -> None:
    """Until it is interrupted, or the robot is gone."""
    cursor = ""
    while True:
        with http.open("GET", path, query={"query": query, "cursor": cursor}) as answer:
            for name, data in events(answer):
                if name == "lines":
                    cursor = data["cursor"]
                    _lines(out, data["lines"])
                elif data["code"] == TAIL_OVER:
                    break
                else:
                    raise GatewayError(str(data["message"]))
            else:
                raise GatewayError("the gateway ended the log")


def _crashes(node: NodeName, robot: OneRobot, gateway: GatewayOption = "", output: FormatOption = Format.TEXT) -> None:
    """How a node ended the last times, with its last lines; the newest first."""
    out = Output(output)
    found = open_gateway(gateway).get(f"{_path(robot, node)}/crashes")["crashes"]
    if out.json:
        out.objects(found)
        return
    for item in found:
        after = f" after {item['ran_s']:g} s" if item["ran_s"] is not None else ""
        version = f", version {item['version']}" if item["version"] else ""
        out.line(out.style(f"{(item['at'] or '?')[:19]}Z  {sanitize(item['reason'])}{after}{sanitize(version)}", "1"))
        for line in item["lines"]:
            out.line(f"    {sanitize(line)}")
    if not found:
        out.note("it has not crashed, as far as the robot remembers")


def _one_of(robot: str, selector: str) -> None:
    if bool(robot) == bool(selector):
        raise UsageError("say --robot R, or -l TERMS for each robot that they name")


def _path(robot: str, node: str) -> str:
    return f"/api/v1/robots/{path_part(robot)}/nodes/{path_part(node)}"


def _lines(out: Output, lines: Sequence[Mapping[str, Any]]) -> None:
    for line in lines:
        if out.json:
            out.object_line(line)
        else:
            out.line(f"{(line['at'] or '?')[:23]}  {sanitize(line['text'])}")


def _row(node: Mapping[str, Any]) -> tuple[str, ...]:
    said = node["reported"] or {}
    notes = [f"{item['what']}: {item['why']}" for item in node["differs"]]
    notes += [f"{node['holder']} runs it"] if node["wanted"] == "standby" else []
    state = node["state"] if node["online"] else f"{node['state']} (offline)"
    since = (said.get("since") or "")[5:16].replace("T", " ")
    pid = said.get("pid")
    cells = (node["robot"], node["name"], state, str(pid or "–"), str(said.get("restarts", "–")), since or "–")
    return (*cells, said.get("version") or "–", sanitize("; ".join(notes))[:80] or "–")
