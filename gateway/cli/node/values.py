"""`metaros node param …` and `metaros node lifecycle …`: of a node that runs on a robot somewhere."""

from __future__ import annotations

import json
from typing import Annotated, Any

import typer

from gateway.cli.name_values import pairs
from gateway.cli.twin_change import DryRun, Reason, send
from gateway.errors import GatewayError
from metaros.cli.shared.gateway_http import GatewayOption, open_gateway, path_part
from metaros.cli.shared.options import Format, FormatOption
from metaros.cli.shared.output import Output, counted
from metaros.errors import UsageError
from metaros.sanitize import sanitize

__all__ = ["add_values"]

NodeName = Annotated[str, typer.Argument(metavar="NODE", help="Its name in the robot's table, as `lidar`.")]
OneRobot = Annotated[str, typer.Option("--robot", "-r", metavar="ROBOT", help="Of this robot.")]
RosName = Annotated[
    str, typer.Option("--ros-name", metavar="NAME", help="Another ROS node of the robot than the one of that name.")
]
Keep = Annotated[bool, typer.Option("--keep", help="In the twin as well: it outlasts the node, and waits for it.")]


def add_values(noun: typer.Typer) -> None:
    """Add the two groups to `metaros node`."""
    param = typer.Typer(no_args_is_help=True, help="Parameters of a robot's running node: list, get, set.")
    param.command("list")(_list)
    param.command("get")(_get)
    param.command("set")(_set)
    noun.add_typer(param, name="param")
    lifecycle = typer.Typer(no_args_is_help=True, help="The state of a robot's managed node: get, set.")
    lifecycle.command("get")(_state)
    lifecycle.command("set")(_change)
    noun.add_typer(lifecycle, name="lifecycle")


def _list(
    node: NodeName,
    robot: OneRobot,
    ros_name: RosName = "",
    gateway: GatewayOption = "",
    output: FormatOption = Format.TEXT,
) -> None:
    """All of them, with types, values and rules."""
    out = Output(output)
    found = open_gateway(gateway).get(_path(robot, node, "parameters"), ros_name=ros_name)
    if out.json:
        out.objects(found)
        return
    rows = [(item["name"], item["type"].replace("_", " "), _shown(item["value"]), _rules(item)) for item in _of(found)]
    out.table(("Parameter", "Type", "Value", "Rules"), rows, empty="no parameters")


def _get(
    node: NodeName,
    name: Annotated[str, typer.Argument(metavar="PARAMETER", help="Its name.")],
    robot: OneRobot,
    ros_name: RosName = "",
    gateway: GatewayOption = "",
    output: FormatOption = Format.TEXT,
) -> None:
    """The value of one."""
    out = Output(output)
    found = open_gateway(gateway).get(_path(robot, node, "parameters"), ros_name=ros_name)
    item = next((item for item in _of(found) if item["name"] == name), None)
    if item is None:
        raise UsageError(f"{found['node']} has no parameter {name!r}; `metaros node param list` shows them")
    if out.json:
        out.objects(item)
    else:
        out.line(_shown(item["value"]))


def _set(
    node: NodeName,
    fields: Annotated[list[str], typer.Argument(metavar="NAME=VALUE…", help="Values as JSON, else text; null: away.")],
    robot: OneRobot,
    keep: Keep = False,
    ros_name: RosName = "",
    dry_run: DryRun = False,
    reason: Reason = "",
    gateway: GatewayOption = "",
    output: FormatOption = Format.TEXT,
) -> None:
    """Set some, each for itself. Ends with 1 where one was refused."""
    values = pairs(fields, shape="NAME=VALUE", example="rate_hz=10")
    query = {"ros_name": ros_name, "dry_run": dry_run, "reason": reason}
    path, body = _path(robot, node, "parameters"), {"parameters": values, "keep": keep}
    found, out = send(open_gateway(gateway), "PATCH", path, body, query=query), Output(output)
    refused = [item for item in found["results"] if not item["successful"]]
    if out.json:
        out.objects(found)
    else:
        for item in found["results"]:
            said = ("would be set" if dry_run else "set") if item["successful"] else "refused"
            out.line(f"{item['name']}  {said}" + (f": {sanitize(item['reason'])}" if item["reason"] else ""))
        if found["revision"] is not None:
            out.note(f"{robot} {'would be' if dry_run else 'is'} at revision {found['revision']}")
    if refused:
        raise GatewayError(f"{counted(len(refused), 'parameter')} refused")


def _state(
    node: NodeName,
    robot: OneRobot,
    ros_name: RosName = "",
    gateway: GatewayOption = "",
    output: FormatOption = Format.TEXT,
) -> None:
    """Its state, and the transitions that lead on from there."""
    out = Output(output)
    found = open_gateway(gateway).get(_path(robot, node, "lifecycle"), ros_name=ros_name)
    if out.json:
        out.objects(found)
    elif not found["managed"]:
        out.note(f"{found['node']} has no lifecycle, or does not run")
    else:
        out.line(found["state"])
        out.note(f"from here: {', '.join(found['transitions']) or 'nowhere'}")


def _change(
    node: NodeName,
    transition: Annotated[
        str, typer.Argument(metavar="TRANSITION", help="configure, activate, deactivate, cleanup, shutdown.")
    ],
    robot: OneRobot,
    keep: Keep = False,
    ros_name: RosName = "",
    dry_run: DryRun = False,
    reason: Reason = "",
    gateway: GatewayOption = "",
    output: FormatOption = Format.TEXT,
) -> None:
    """Have it make a transition. Ends with 1 where it stays what it is."""
    query = {"ros_name": ros_name, "dry_run": dry_run, "reason": reason}
    path, body = _path(robot, node, "lifecycle"), {"transition": transition, "keep": keep}
    found, out = send(open_gateway(gateway), "POST", path, body, query=query), Output(output)
    if out.json:
        out.objects(found)
    else:
        out.line(f"{found['node']} is {found['state']}" + ("; it could" if dry_run and found["success"] else ""))
    if not found["success"]:
        ways = ", ".join(found["transitions"]) or "none"
        raise GatewayError(f"{found['node']} stays {found['state']}; from here: {ways}")


def _of(found: dict[str, Any]) -> list[dict[str, Any]]:
    return list(found["parameters"])


def _shown(value: Any) -> str:
    return sanitize(value if isinstance(value, str) else json.dumps(value, ensure_ascii=False))


def _rules(item: dict[str, Any]) -> str:
    bounds = item["integer_range"] or item["floating_point_range"]
    rules = ["read-only"] if item["read_only"] else []
    if bounds:
        rules.append(f"{bounds['from']:g} to {bounds['to']:g}" + (f" by {bounds['step']:g}" if bounds["step"] else ""))
    rules += [sanitize(text) for text in (item["constraints"], item["description"]) if text]
    return "; ".join(rules) or "–"


def _path(robot: str, node: str, what: str) -> str:
    return f"/api/v1/robots/{path_part(robot)}/nodes/{path_part(node)}/{what}"
