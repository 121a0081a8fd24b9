"""What a worker runs and within which bounds: the words of `launch` and `Zygote`."""

from __future__ import annotations

import os
import sys
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Literal

from metaros.automation.functions.sandbox.level import Level

__all__ = ["Confinement", "Entry", "Program", "import_paths", "request_of", "shown_paths"]

MIB = 1 << 20
PACKAGE = Path(__file__).resolve().parents[2]  # metaros
Entry = Literal["awslambdaric", "metaros", "none"]  # none: ends at once, by which a level is probed


@dataclass(frozen=True, slots=True, kw_only=True)
class Program:
    """A handler (`module.function`) in an unpacked folder, its layers, and all of its environment: nothing of the
    gateway's is inherited. `entry` is the Runtime API's client: AWS's own, or ours,
    `metaros.automation.functions.runtime.runtime_client`. `egress`: it has a way out, by a proxy that is to be served
    on `WorkerProcess.egress`."""

    handler: str
    code_dir: Path
    layer_dirs: tuple[Path, ...] = ()
    env: Mapping[str, str] = field(default_factory=dict)
    entry: Entry = "awslambdaric"
    egress: bool = False


@dataclass(frozen=True, slots=True, kw_only=True)
class Confinement:
    """How a worker is shut in. `tmp_dir` is its own folder, made where it is missing; at L3 /tmp is in memory instead,
    bounded by `disk_bytes`, which elsewhere bounds one file. `memory_mb` is on top of the interpreter's own.

    `uid` and `gid` count where the gateway is root; None is a user of this worker alone.
    """

    level: Level
    tmp_dir: Path
    memory_mb: int = 128
    processes: int = 64
    open_files: int = 1024
    disk_bytes: int = 512 * MIB
    uid: int | None = None
    gid: int | None = None


def shown_paths() -> list[str]:
    """The folders of this interpreter and of what is installed for it: all that a worker reads beside its own."""
    installed = [path for path in sys.path if path.endswith(("site-packages", "dist-packages"))]
    return sorted({os.path.abspath(p) for p in (sys.base_prefix, sys.prefix, str(PACKAGE), *installed)})


def import_paths() -> list[str]:
    """Of this process's import path, what lies in `shown_paths`, and where `metaros` is found."""
    shown, home = shown_paths(), str(PACKAGE.parent)
    inside = [path for path in sys.path if any(path == s or path.startswith(s + "/") for s in shown)]
    return inside if home in inside else [*inside, home]


def request_of(program: Program, confinement: Confinement, *, port: int, egress_port: int) -> dict[str, Any]:
    """Both as the fork server reads them; where the worker shares our network, `port` is of the Runtime API and
    `egress_port` of its proxy."""
    return {
        "level": int(confinement.level),
        "handler": program.handler,
        "entry": program.entry,
        "env": dict(program.env),
        "code_dir": str(program.code_dir.absolute()),
        "layer_dirs": [str(folder.absolute()) for folder in program.layer_dirs],
        "tmp_dir": str(confinement.tmp_dir.absolute()),
        "memory_mb": confinement.memory_mb,
        "processes": confinement.processes,
        "open_files": confinement.open_files,
        "disk_bytes": confinement.disk_bytes,
        "uid": confinement.uid,
        "gid": confinement.gid,
        "port": port,
        "egress": program.egress,
        "egress_port": egress_port,
        "shown": shown_paths(),
        "runtime_dir": str(PACKAGE / "functions"),
    }
