"""From a wanted node to a row of the supervisor's table: its program, found or refused. Pure."""

from __future__ import annotations

import json
import sys
from collections.abc import Iterator, Mapping
from dataclasses import asdict
from typing import Any, Final

from edge_agent.config.node_settings import Allowed, NodeSettings
from edge_agent.nodes.bundles import Bundle
from edge_agent.nodes.container import check_container, run_argv, take_away_argv
from edge_agent.nodes.errors import NodeRefusedError
from metaros.drivers.registry import manifest_of
from metaros.drivers.values import read_values
from metaros.errors import ConfigError
from metaros.fleet.twin.document import NodeSpec
from metaros.supervise.node_table_file import Row
from metaros.supervise.restart_policy import Restart

__all__ = ["LaunchContext", "as_json", "check_allowed", "launch_row"]

CHILD: Final = ("-m", "metaros.cli.launch_child")  # in node tables on robots' disks: the name stays
HEARTBEAT_S: Final = 2.0


class LaunchContext:
    """What a node needs to join this robot's graph: router, domain, namespace."""

    def __init__(
        self,
        *,
        namespace: str,
        zenoh_port: int,
        domain: int = 0,
        python: str = "",
        env: Mapping[str, str] | None = None,
        drive_session: str = "",
    ) -> None:
        """`drive_session`: the Zenoh session file of whoever may drive, where not everybody may."""
        self.namespace = namespace
        self.drive_session = drive_session
        self.python = python or sys.executable
        self.env = {
            "PYTHONUNBUFFERED": "1",
            "METAROS_ZENOH_PORT": str(zenoh_port),
            "ROS_DOMAIN_ID": str(domain),
            **(env or {}),
        }


def check_allowed(node: NodeSpec, settings: NodeSettings) -> None:
    """Raise NodeRefusedError where this robot's settings do not let it run."""
    if node.command and not settings.free_commands:
        raise NodeRefusedError(
            f"{node.name}: this robot takes no free commands: name a bundle, or an entry of its own [[allowed]]"
        )
    if not node.allowed:
        return
    entry = settings.allowed.get(node.allowed)
    if entry is None:
        there = ", ".join(sorted(settings.allowed)) or "nothing"
        raise NodeRefusedError(f"{node.name}: {node.allowed!r} is not in this robot's [[allowed]]; there is: {there}")
    if node.args and not entry.args:
        raise NodeRefusedError(
            f"{node.name}: the robot's [[allowed]] {entry.name!r} takes no arguments from the gateway"
        )
    if node.parameters and not entry.parameters:
        raise NodeRefusedError(
            f"{node.name}: the robot's [[allowed]] {entry.name!r} takes no parameters from the gateway"
        )
    if entry.driver:
        _check_driver(node, entry)


def _check_driver(node: NodeSpec, entry: Allowed) -> None:
    """What a driver opens, and what it may move, is this robot's own word: see Manifest."""
    manifest = manifest_of(entry.driver)
    try:
        read_values(manifest, node.parameters)
    except ConfigError as error:
        raise NodeRefusedError(f"{node.name}: {error}") from None
    for name in node.parameters:
        if name in entry.fixed or manifest.parameter(name).local:
            raise NodeRefusedError(
                f"{node.name}: {entry.driver}: {name} is set on the robot only, by `fixed` of its [[allowed]] entry"
            )


def launch_row(node: NodeSpec, settings: NodeSettings, place: LaunchContext, bundle: Bundle | None = None) -> Row:
    """The row; `bundle` is the one that it names. Raises NodeRefusedError."""
    check_allowed(node, settings)
    argv, env, cwd, ours, named = _program(node, settings, place, bundle)
    fixed = settings.allowed[node.allowed].fixed if node.allowed else {}
    ros = tuple(_ros_args(node, place, {**node.parameters, **fixed}, named=named))
    return Row(
        name=node.name,
        argv=(*argv, *node.args, *(("--ros-args", *ros) if ros else ())),
        cwd=cwd,
        env={**place.env, **env},
        version=node.version if bundle is not None else "",
        restart=Restart(node.restart),
        critical=node.critical,
        nice=node.nice,
        after=node.after,
        run=node.run,
        migratable=node.migratable,
        clean_up=take_away_argv(node, bundle) if bundle is not None and bundle.image else (),
        safe_stop=tuple(_safe_stop(settings, place)) if node.critical else (),
        own_guard=ours,
        heartbeat_s=HEARTBEAT_S,
    )


def as_json(row: Row) -> dict[str, Any]:
    """As the control protocol has it."""
    return asdict(row)


def _safe_stop(settings: NodeSettings, place: LaunchContext) -> Iterator[str]:
    """The program that brings this robot to rest, as its settings say; nothing where they say nothing."""
    if not (settings.safe_stop or settings.safe_stop_service or settings.safe_stop_publish):
        return
    yield from (place.python, "-m", "metaros.cli.safe_stop", f"--namespace={place.namespace}")
    if place.drive_session:
        yield f"--session={place.drive_session}"
    for topic, name in settings.safe_stop_publish.items():
        yield f"--publish={topic}={name}"
    if settings.safe_stop_service:
        yield f"--call={settings.safe_stop_service}"
    yield from ("--", *settings.safe_stop)


Program = tuple[tuple[str, ...], Mapping[str, str], str, bool, bool]


def _program(node: NodeSpec, settings: NodeSettings, place: LaunchContext, bundle: Bundle | None) -> Program:
    """argv, environment, directory, whether it dies with the supervisor by itself, whether it takes our name."""
    if node.command:
        return node.command, {}, "", False, False
    if node.bundle:
        if bundle is None:
            raise NodeRefusedError(f"{node.name}: bundle {node.bundle} {node.version} is not here")
        if bundle.image:
            check_container(node)
            return run_argv(node, bundle, place.env.items()), {}, str(bundle.folder), False, False
        return bundle.argv, {}, str(bundle.folder), False, bundle.argv[1:2] == ("-I",)
    entry = settings.allowed[node.allowed]
    if entry.command:
        return entry.command, entry.env, entry.cwd, False, False
    if entry.driver:
        what = ("driver", entry.driver)
    else:
        what = ("module", entry.module) if entry.module else ("class", entry.class_)
    return (place.python, *CHILD, *what), entry.env, entry.cwd, True, True


def _ros_args(node: NodeSpec, place: LaunchContext, parameters: Mapping[str, Any], *, named: bool) -> Iterator[str]:
    """Name, namespace and parameters as ROS 2 passes them; a command gets them only where it has parameters."""
    if named:
        yield from ("-r", f"__node:={node.name}")
    if place.namespace != "/" and (named or parameters):
        yield from ("-r", f"__ns:={place.namespace}")
    for name, value in parameters.items():
        yield from ("-p", f"{name}:={json.dumps(value, ensure_ascii=False)}")
