"""Packages of a ROS 2 workspace that nobody has built: folders with a `package.xml`, and what they can run.

Entry points are read from `setup.py`, `setup.cfg` or `pyproject.toml`; nothing is executed.
"""

from __future__ import annotations

import ast
import os
import re
from collections.abc import Iterator, Mapping
from configparser import ConfigParser
from configparser import Error as ConfigParserError
from dataclasses import dataclass
from pathlib import Path
from typing import Final

__all__ = ["SourcePackage", "source_packages"]

_NAME: Final = re.compile(r"<name>\s*([A-Za-z][\w-]*)\s*</name>")
_COMMENT: Final = re.compile(r"<!--.*?-->", re.DOTALL)
_ENTRY: Final = re.compile(r"\s*([\w.-]+)\s*=\s*([\w.]+)\s*:\s*([\w.]+)")
_SKIPPED: Final = frozenset({"build", "install", "log", "node_modules", "__pycache__", "site-packages"})
_MARKS: Final = ("COLCON_IGNORE", "AMENT_IGNORE", "CATKIN_IGNORE")
_DEPTH: Final = 5
_FOLDERS: Final = 5000
_FILE_BYTES: Final = 1024 * 1024
_SCRIPTS: Final = ("scripts", "nodes", "bin", "src", ".")


@dataclass(frozen=True, slots=True)
class SourcePackage:
    """A folder with a `package.xml`."""

    name: str
    folder: Path

    def entry_points(self) -> dict[str, str]:
        """Executables with the function each calls, `package.module:function`."""
        found = _of_setup_py(_text(self.folder / "setup.py"))
        found.update(_of_setup_cfg(_text(self.folder / "setup.cfg")))
        found.update(_of_pyproject(_text(self.folder / "pyproject.toml")))
        return found

    def scripts(self) -> dict[str, Path]:
        """Python files that CMake would install as executables: by their names, and without `.py`."""
        found: dict[str, Path] = {}
        for part in (*_SCRIPTS, self.name):
            for path in sorted(self.folder.joinpath(part).glob("*")) if self.folder.joinpath(part).is_dir() else ():
                if is_python(path) and path.name not in ("setup.py", "__init__.py", "conftest.py"):
                    found.setdefault(path.name, path)
                    found.setdefault(path.stem, path)
        return found


def is_python(path: Path) -> bool:
    """Whether Python runs the file: by its ending, or its first line."""
    if not path.is_file():
        return False
    if path.suffix in (".py", ".pyc"):
        return True
    if path.suffix:
        return False
    try:
        with path.open("rb") as file:
            line = file.readline(256)
    except OSError:
        return False
    return line.startswith(b"#!") and b"python" in line


def source_packages(root: Path) -> Iterator[SourcePackage]:
    """The packages at and beneath a folder, as colcon would find them: not inside one another."""
    budget = _FOLDERS
    pending = [(root, 0)]
    while pending and budget:
        folder, depth = pending.pop()
        budget -= 1
        try:
            with os.scandir(folder) as entries:
                names = {entry.name: entry.is_dir() for entry in entries}
        except OSError:
            continue
        if any(mark in names for mark in _MARKS):
            continue
        if "package.xml" in names:
            name = _NAME.search(_COMMENT.sub("", _text(folder / "package.xml")))
            if name is not None:
                yield SourcePackage(name[1], folder)
                continue
        if depth < _DEPTH:
            inner = [name for name, is_folder in names.items() if is_folder and _worth_a_look(name)]
            pending += [(folder / name, depth + 1) for name in sorted(inner, reverse=True)]


def _worth_a_look(name: str) -> bool:
    return name not in _SKIPPED and not name.startswith(".")


def _text(path: Path) -> str:
    try:
        with path.open("rb") as file:
            return file.read(_FILE_BYTES).decode(errors="replace")
    except OSError:
        return ""


def _entries(lines: object) -> dict[str, str]:
    found = {}
    for line in lines if isinstance(lines, list) else str(lines or "").splitlines():
        entry = _ENTRY.match(str(line))
        if entry is not None:
            found[entry[1]] = f"{entry[2]}:{entry[3]}"
    return found


def _of_setup_cfg(text: str) -> dict[str, str]:
    parser = ConfigParser(interpolation=None)
    try:
        parser.read_string(text)
    except ConfigParserError:
        return {}
    return _entries(parser.get("options.entry_points", "console_scripts", fallback=""))


def _of_pyproject(text: str) -> dict[str, str]:
    if "scripts" not in text:
        return {}
    import tomllib

    try:
        tree = tomllib.loads(text)
    except tomllib.TOMLDecodeError:
        return {}
    project = tree.get("project")
    scripts = project.get("scripts") if isinstance(project, Mapping) else None
    return _entries([f"{name} = {value}" for name, value in scripts.items()]) if isinstance(scripts, Mapping) else {}


def _of_setup_py(text: str) -> dict[str, str]:
    """What `setup(entry_points={"console_scripts": [...]})` says, its constants put in."""
    try:
        return _console_scripts(ast.parse(text))
    except (SyntaxError, ValueError, MemoryError, RecursionError):  # the last two also where it nests without end
        return {}


def _console_scripts(tree: ast.Module) -> dict[str, str]:
    known: dict[str, object] = {}
    found: dict[str, str] = {}
    for node in ast.walk(tree):
        if isinstance(node, ast.Assign) and len(node.targets) == 1 and isinstance(node.targets[0], ast.Name):
            known[node.targets[0].id] = _value(node.value, known)
    for node in ast.walk(tree):
        if isinstance(node, ast.Call) and getattr(node.func, "id", getattr(node.func, "attr", "")) == "setup":
            for keyword in node.keywords:
                if keyword.arg == "entry_points":
                    points = _value(keyword.value, known)
                    if isinstance(points, Mapping):
                        found.update(_entries(points.get("console_scripts")))
    return found


def _value(node: ast.expr, known: Mapping[str, object]) -> object:
    """The value of an expression of constants, names that were given one, `+` and f-strings; else None."""
    match node:
        case ast.Constant(value=value):
            return value
        case ast.Name(id=name):
            return known.get(name)
        case ast.List(elts=items) | ast.Tuple(elts=items):
            return [_value(item, known) for item in items]
        case ast.Dict(keys=keys, values=values):
            pairs = zip(keys, values, strict=True)
            return {_value(key, known): _value(value, known) for key, value in pairs if isinstance(key, ast.Constant)}
        case ast.BinOp(left=left, op=ast.Add(), right=right):
            one, two = _value(left, known), _value(right, known)
            if isinstance(one, str) and isinstance(two, str):
                return one + two
            return one + two if isinstance(one, list) and isinstance(two, list) else None
        case ast.JoinedStr(values=parts):
            return "".join(str(_value(part, known)) for part in parts)
        case ast.FormattedValue(value=inner):
            return _value(inner, known)
    return None
