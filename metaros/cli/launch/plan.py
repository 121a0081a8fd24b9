"""From a launch table to processes: their command lines, environments and logs; and whether what they name exists."""

from __future__ import annotations

import json
import os
import shlex
import shutil
import sys
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from importlib.machinery import PathFinder
from pathlib import Path
from typing import Any

from metaros.errors import ConfigError
from metaros.supervise import Launch, LaunchTable, NodeRow

__all__ = ["ALL_NODES", "PROGRAM", "Place", "check_exists", "launches", "node_names"]


PROGRAM = (sys.executable, "-m", "metaros.cli.launch_child")
ALL_NODES = {"PYTHONUNBUFFERED": "1"}


@dataclass(frozen=True, slots=True, kw_only=True)
class Place:
    """Where the table is launched."""

    zenoh_port: int
    domain: int
    log_dir: Path


def check_exists(table: LaunchTable) -> None:
    """ConfigError for the first module or program that cannot be found; nothing is imported."""
    for row in table.nodes:
        where = f"{table.path.name}: [[node]] {row.name!r}"
        if row.command:
            program = row.command[0]
            if shutil.which(program) is None and not (table.folder / program).is_file():
                raise ConfigError(f"{where}: command: there is no program {program!r}")
            continue
        if row.driver:
            _check_driver(row, where)
            continue
        if row.ros2:
            _check_ros2(row, table.folder, where)
            continue
        module = row.module or row.class_.partition(":")[0]
        if not _module_exists(module, table.folder):
            key = "module" if row.module else "class"
            raise ConfigError(f"{where}: {key}: there is no module {module!r}, neither in {table.folder} nor installed")


def _check_driver(row: NodeRow, where: str) -> None:
    from metaros.drivers import manifest_of
    from metaros.drivers.values import read_values

    try:
        manifest = manifest_of(row.driver)
        manifest.check_runnable()
        read_values(manifest, row.parameters)
    except ConfigError as error:
        raise ConfigError(f"{where}: driver: {error}") from None


def _check_ros2(row: NodeRow, folder: Path, where: str) -> None:
    from metaros.ros2.programs import find_program

    try:
        find_program(shlex.split(row.ros2), folder=folder, environ={**os.environ, **row.env})
    except ConfigError as error:
        raise ConfigError(f"{where}: ros2: {error}") from None


def _module_exists(name: str, folder: Path) -> bool:
    """Whether Python would find it from the table's folder; packages are searched, not run."""
    path: Any = [str(folder), *sys.path]
    for part in name.split("."):
        spec = PathFinder.find_spec(part, path)
        if spec is None:
            return False
        path = spec.submodule_search_locations or []
    return True


def launches(table: LaunchTable, place: Place) -> tuple[Launch, ...]:
    """The rows for the supervisor, in the order of their start."""
    stages: dict[str, int] = {}
    rows = []
    for row in table.nodes:
        stages[row.name] = max((stages[name] + 1 for name in row.after), default=0)
        rows.append(_launch(row, table, place, stages[row.name]))
    return tuple(rows)


def node_names(table: LaunchTable) -> Mapping[str, str]:
    """Row name to the full name of the node that the graph will show, where that is known."""
    return {
        row.name: f"{row.namespace.rstrip('/')}/{row.name}"
        for row in table.nodes
        if not row.command and row.rename  # a command may be no node at all
    }


def _what(row: NodeRow) -> tuple[str, str]:
    if row.driver:
        return "driver", row.driver
    if row.ros2:
        return "ros2", row.ros2
    return ("module", row.module) if row.module else ("class", row.class_)


def _launch(row: NodeRow, table: LaunchTable, place: Place, stage: int) -> Launch:
    what = row.command or (*PROGRAM, *_what(row))
    ros = tuple(_ros_args(row))
    return Launch(
        name=row.name,
        argv=(*what, *row.args, *(("--ros-args", *ros) if ros else ())),
        log_path=place.log_dir / f"{row.name}.log",
        stage=stage,
        env={
            "METAROS_ZENOH_PORT": str(place.zenoh_port),
            "ROS_DOMAIN_ID": str(place.domain),
            **ALL_NODES,
            **table.env,
            **row.env,
        },
        cwd=table.folder,
        policy=row.policy,
        log_bytes=table.log_bytes,
        after=row.after,
        rest_for_one=row.rest_for_one,
        heartbeat_s=table.heartbeat_s if row.heartbeat else 0.0,
        stop_grace_s=row.stop_grace_s,
        nice=row.nice,
        own_guard=not row.command,
        program_words=len(PROGRAM),
    )


def _ros_args(row: NodeRow) -> Iterator[str]:
    """Name, namespace, remappings and parameters as ROS 2 passes them; a command gets only what its row asks for."""
    if row.rename and not row.command:
        yield from ("-r", f"__node:={row.name}")
    if row.namespace:
        yield from ("-r", f"__ns:={row.namespace}")
    for name, target in row.remap.items():
        yield from ("-r", f"{name}:={target}")
    if row.parameter_file is not None:
        yield from ("--params-file", str(row.parameter_file))
    for name, value in row.parameters.items():
        yield from ("-p", f"{name}:={_yaml(value)}")


def _yaml(value: object) -> str:
    """A value as YAML reads it back: JSON is YAML, but for the words of floating point."""
    if isinstance(value, float) and (value != value or value in (float("inf"), float("-inf"))):
        return ".nan" if value != value else ".inf" if value > 0 else "-.inf"
    return json.dumps(value, ensure_ascii=False)
