"""The supervisor's node table on disk: what runs on this robot, so that it comes back alone after a power cut.

One JSON file, replaced as a whole. Its `version` grows by one with each change. A row holds everything that a process
needs: whoever gives the table has found programs and arguments before.
"""

from __future__ import annotations

import json
import os
import re
import sys
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, field, fields
from pathlib import Path
from typing import Any, Final

from metaros.errors import ConfigError
from metaros.limits import LIMITS
from metaros.supervise.restart_policy import Restart, RestartPolicy

__all__ = ["MAX_BYTES", "MAX_ROWS", "Row", "Table", "TableFile", "read_rows", "write_whole"]

FORMAT: Final = 1
MAX_ROWS: Final = LIMITS.robot_nodes
MAX_BYTES: Final = LIMITS.node_table_bytes
_WORDS: Final = 1024
_TEXT: Final = 32 * 1024
_NAME: Final = re.compile(r"[A-Za-z_][A-Za-z0-9_-]{0,63}\Z")
_NUMBERS: Final = {  # key: least, most
    "nice": (-20, 19),
    "heartbeat_s": (0.0, 3600.0),
    "stop_grace_s": (0.0, 600.0),
    "log_bytes": (65_536, 1 << 30),
    "base_delay_s": (0.0, 3600.0),
    "max_delay_s": (0.0, 86_400.0),
    "healthy_after_s": (0.0, 86_400.0),
    "window_s": (0.0, 86_400.0),
    "window_exits": (0, 10_000),
    "quarantine_s": (0.0, 86_400.0),
}


@dataclass(frozen=True, slots=True, kw_only=True)
class Row:
    """A node: its program, and how it is kept running."""

    name: str
    argv: tuple[str, ...]
    cwd: str = ""  # empty: the supervisor's state directory
    env: Mapping[str, str] = field(default_factory=dict)
    version: str = ""  # shown; another one is another program
    restart: Restart = Restart.ALWAYS
    critical: bool = False
    nice: int = 0
    after: tuple[str, ...] = ()
    rest_for_one: bool = False
    run: bool = True
    migratable: bool = False  # it runs only while its lease holds
    safe_stop: tuple[str, ...] = ()  # run where it is critical and keeps dying
    clean_up: tuple[str, ...] = ()  # run before the first start and after each end: what it leaves beside its group
    own_guard: bool = False
    heartbeat_s: float = 0.0
    stop_grace_s: float = 5.0
    log_bytes: int = LIMITS.node_log_bytes
    base_delay_s: float = 0.1
    max_delay_s: float = 30.0
    healthy_after_s: float = 60.0
    window_s: float = 300.0
    window_exits: int = 10
    quarantine_s: float = 300.0

    @property
    def program(self) -> tuple[object, ...]:
        """What a running process cannot change: where this differs, it is started again."""
        return (self.argv, self.cwd, dict(self.env), self.version, self.own_guard, self.heartbeat_s, self.log_bytes)

    @property
    def policy(self) -> RestartPolicy:
        """Its restart policy."""
        return RestartPolicy(
            restart=self.restart,
            critical=self.critical,
            base_delay_s=self.base_delay_s,
            max_delay_s=self.max_delay_s,
            healthy_after_s=self.healthy_after_s,
            window_s=self.window_s,
            window_exits=self.window_exits,
            quarantine_s=self.quarantine_s,
        )


@dataclass(frozen=True, slots=True)
class Table:
    """All rows, and which of them somebody has stopped by hand."""

    rows: tuple[Row, ...] = ()
    stopped: frozenset[str] = frozenset()
    version: int = 0
    tag: str = ""  # of whoever gave it: the digest of what it was made from


class TableFile:
    """The file. `table` is what it holds."""

    def __init__(self, path: Path) -> None:
        """Read it; ConfigError where it is damaged, which its writer never leaves."""
        self._path = path
        self.table = self._read()

    def replace(self, rows: Sequence[Row], stopped: frozenset[str], *, tag: str) -> Table:
        """Put this on disk, then make it `table`. Raises OSError, and nothing has changed then."""
        names = {row.name for row in rows}
        table = Table(tuple(rows), stopped & names, self.table.version + 1, tag)
        tree = {
            "format": FORMAT,
            "version": table.version,
            "tag": table.tag,
            "stopped": sorted(table.stopped),
            "rows": [asdict(row) for row in rows],
        }
        write_whole(self._path, json.dumps(tree, indent=1).encode())
        self.table = table
        return table

    def _read(self) -> Table:
        try:
            with self._path.open("rb") as file:
                data = file.read(4 * MAX_BYTES + 1)
        except FileNotFoundError:
            return Table()
        except OSError as error:
            raise ConfigError(f"{self._path}: {error.strerror}") from None
        try:
            tree = json.loads(data)
            if tree["format"] != FORMAT:
                raise ConfigError(f"{self._path}: format {tree['format']}, and this program knows {FORMAT}")
            stopped = frozenset(str(name) for name in tree["stopped"])
            return Table(read_rows(tree["rows"]), stopped, int(tree["version"]), str(tree["tag"]))
        except (ValueError, KeyError, TypeError, RecursionError) as error:
            raise ConfigError(f"{self._path}: no table of a supervisor: {error}") from None


def write_whole(path: Path, data: bytes) -> None:
    """Put a file in the place of another so that after any power cut one of them is there."""
    draft = path.with_name(f"{path.name}.tmp")
    descriptor = os.open(draft, os.O_WRONLY | os.O_CREAT | os.O_TRUNC, 0o600)
    with open(descriptor, "wb") as file:
        file.write(data)
        file.flush()
        os.fsync(file.fileno())
    draft.replace(path)
    if sys.platform != "win32":
        folder = os.open(path.parent, os.O_RDONLY)
        try:
            os.fsync(folder)
        finally:
            os.close(folder)


def read_rows(found: object) -> tuple[Row, ...]:
    """Rows as JSON, checked; in an order in which they can be started. ConfigError names row and key."""
    if not isinstance(found, list):
        raise ConfigError("rows: expected a list")
    if len(found) > MAX_ROWS:
        raise ConfigError(f"rows: {len(found)}; at most {MAX_ROWS} are taken")
    rows: dict[str, Row] = {}
    for item in found:
        row = _row(item)
        if row.name in rows:
            raise ConfigError(f"{row.name}: two nodes have this name")
        rows[row.name] = row
    return _ordered(rows)


def check_name(name: object) -> str:
    """A node's name; ConfigError."""
    if not isinstance(name, str) or not _NAME.match(name):
        raise ConfigError("name: a letter or _, then letters, digits, _ and -, at most 64")
    return name


def _row(item: object) -> Row:
    if not isinstance(item, dict):
        raise ConfigError("rows: expected objects")
    name = check_name(item.get("name"))
    known = {entry.name for entry in fields(Row)}
    for key in item:
        if key not in known:
            raise ConfigError(f"{name}: unknown key {str(key)[:40]!r}")
    values: dict[str, Any] = {"name": name, "argv": _texts(item.get("argv"), name, "argv")}
    if not values["argv"] or not values["argv"][0]:
        raise ConfigError(f"{name}: argv: expected a program and its arguments")
    for key in item.keys() - {"name", "argv"}:
        values[key] = _value(item[key], name, key)
    return Row(**values)


def _value(found: object, name: str, key: str) -> object:
    if key in _NUMBERS:
        low, high = _NUMBERS[key]
        whole = isinstance(low, int)
        if isinstance(found, bool) or not isinstance(found, int if whole else (int, float)):
            raise ConfigError(f"{name}: {key}: expected a {'whole ' if whole else ''}number")
        if not low <= found <= high:
            raise ConfigError(f"{name}: {key}: {low:g} to {high:g}, not {found}")
        return found
    match key:
        case "env":
            return _environment(found, name)
        case "after" | "safe_stop" | "clean_up":
            return _texts(found, name, key)
        case "cwd" | "version":
            if not isinstance(found, str) or "\0" in found or len(found) > 4096:
                raise ConfigError(f"{name}: {key}: expected a text")
            return found
        case "restart":
            if found not in list(Restart):
                raise ConfigError(f"{name}: restart: {str(found)[:40]!r} is none of {', '.join(Restart)}")
            return Restart(str(found))
        case _:
            if not isinstance(found, bool):
                raise ConfigError(f"{name}: {key}: expected true or false")
            return found


def _texts(found: object, name: str, key: str) -> tuple[str, ...]:
    if not isinstance(found, list | tuple) or len(found) > _WORDS:
        raise ConfigError(f"{name}: {key}: expected a list of at most {_WORDS} texts")
    for text in found:
        if not isinstance(text, str) or "\0" in text or len(text) > _TEXT:
            raise ConfigError(f"{name}: {key}: expected texts without NUL, at most {_TEXT} characters each")
    return tuple(found)


def _environment(found: object, name: str) -> dict[str, str]:
    if not isinstance(found, dict) or len(found) > _WORDS:
        raise ConfigError(f"{name}: env: expected at most {_WORDS} texts by name")
    for key, text in found.items():
        if not key or not isinstance(text, str) or "=" in key or "\0" in key + text or len(key + text) > _TEXT:
            raise ConfigError(f"{name}: env: {key[:40]!r}: expected a text without NUL")
    return dict(found)


def _ordered(rows: dict[str, Row]) -> tuple[Row, ...]:
    """Each behind those it comes after; who comes after nobody known is told so, a circle too."""
    ordered: dict[str, Row] = {}
    waiting = dict(rows)
    for row in rows.values():
        for name in row.after:
            if name not in rows:
                raise ConfigError(f"{row.name}: after: there is no node {name[:64]!r}")
    while waiting:
        free = [row for row in waiting.values() if all(name in ordered for name in row.after)]
        if not free:
            raise ConfigError(f"after: a circle among {', '.join(sorted(waiting))}")
        for row in free:
            ordered[row.name] = waiting.pop(row.name)
    return tuple(ordered.values())
