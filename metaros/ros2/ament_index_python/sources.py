"""Packages that are run from their source, without being installed: their own folder stands for the installation.

Such a package is a folder with a `package.xml` that says its name: on `sys.path`, above the program being run, or at
or beneath the current folder. It shares its folder. What its `setup.py` would install somewhere else in the share
folder is linked to that place, in a folder of links that goes away with the process.
"""

from __future__ import annotations

import ast
import re
import sys
import tempfile
from collections.abc import Iterator
from functools import cache
from pathlib import Path
from typing import Any, Final

from metaros.ros2.programs.source_packages import source_packages

__all__ = ["share_of", "source_of"]

_NAME: Final = re.compile(rb"<name>\s*([A-Za-z0-9][A-Za-z0-9_-]*)\s*</name>")
_UP: Final = 5  # folders above a program in which its package.xml is looked for
_LONGEST: Final = 1 << 20  # bytes of a package.xml or a setup.py that are read
_MOST_FILES: Final = 5000  # that one package installs


def source_of(package_name: str) -> Path | None:
    """The folder of a package that is here as source, or None."""
    for folder in _folders():
        if _named(folder) == package_name:
            return folder
    here = Path.cwd()
    for package in source_packages(here) if here != here.parent else ():  # not all of the disk, where services start
        if package.name == package_name:
            return package.folder
    return None


def share_of(folder: Path, package_name: str) -> Path:
    """What stands for the share folder of the package in this folder."""
    try:
        found = list(_installed(folder, package_name))
    except RecursionError:  # a setup.py that nests without end
        return folder
    moved = {target: source for target, source in found if source.is_file() and not (folder / target).exists()}
    return _linked(folder, tuple(moved.items())) if moved else folder


@cache
def _linked(folder: Path, moved: tuple[tuple[str, Path], ...]) -> Path:
    """A folder of links to all that is in this one, and to what belongs elsewhere."""
    holder = tempfile.TemporaryDirectory(prefix="metaros-share-")
    _holders.append(holder)
    view = Path(holder.name) / folder.name
    view.mkdir()
    inner = {target.partition("/")[0] for target, _ in moved if "/" in target}
    for path in folder.iterdir():
        if path.name in inner and path.is_dir():
            (view / path.name).mkdir()
            for below in path.iterdir():
                (view / path.name / below.name).symlink_to(below)
        else:
            (view / path.name).symlink_to(path)
    for target, source in moved:
        place = view / target
        place.parent.mkdir(parents=True, exist_ok=True)
        place.symlink_to(source)
    return view


_holders: list[tempfile.TemporaryDirectory[str]] = []  # they go when the process ends


def _folders() -> Iterator[Path]:
    yield from (Path(entry).resolve() for entry in list(sys.path) if entry)
    program = getattr(sys.modules.get("__main__"), "__file__", None)
    if program:
        yield from Path(program).resolve().parents[:_UP]


def _named(folder: Path) -> str | None:
    """What the package.xml of this folder calls it."""
    found = _NAME.search(_read(folder / "package.xml"))
    return None if found is None else found[1].decode()


def _read(path: Path) -> bytes:
    try:
        with path.open("rb") as file:
            return file.read(_LONGEST)
    except OSError:
        return b""


def _installed(folder: Path, package_name: str) -> Iterator[tuple[str, Path]]:
    """What the `data_files` of a `setup.py` put into the share folder: the place there, and the file. It is not run."""
    try:
        tree = ast.parse(_read(folder / "setup.py"))
    except (SyntaxError, ValueError, MemoryError):
        return
    names = {"package_name": package_name}
    share, count = f"share/{package_name}", 0
    for node in ast.walk(tree):
        if isinstance(node, ast.Assign) and isinstance(node.targets[0], ast.Name):
            for text in _texts(node.value, names, folder)[:1]:
                names[node.targets[0].id] = text
    for node in ast.walk(tree):
        listed = node.value if isinstance(node, ast.keyword) and node.arg == "data_files" else None
        for pair in listed.elts if isinstance(listed, (ast.List, ast.Tuple)) else ():
            if not isinstance(pair, ast.Tuple) or len(pair.elts) != 2:
                continue
            into = "".join(_texts(pair.elts[0], names, folder)[:1]).strip("/")
            if into != share and not into.startswith(f"{share}/"):
                continue
            for text in _texts(pair.elts[1], names, folder):
                source = folder / text
                if ".." not in Path(into).parts and (count := count + 1) <= _MOST_FILES:
                    yield "/".join(filter(None, (into[len(share) + 1 :], source.name))), source.resolve()


def _texts(node: ast.expr, names: dict[str, str], folder: Path) -> list[str]:
    """The texts that an expression of texts, joined paths and globs stands for; none for what is anything else."""
    if isinstance(node, ast.Constant):
        return [node.value] if isinstance(node.value, str) else []
    if isinstance(node, ast.Name):
        return [names[node.id]] if node.id in names else []
    if isinstance(node, (ast.List, ast.Tuple)):
        return [text for part in node.elts for text in _texts(part, names, folder)]
    if isinstance(node, ast.JoinedStr):
        parts = [part.value if isinstance(part, ast.FormattedValue) else part for part in node.values]
        return _joined("", parts, names, folder)
    if isinstance(node, ast.BinOp) and isinstance(node.op, ast.Add):
        if isinstance(node.left, ast.List) or isinstance(node.right, ast.List):
            return [*_texts(node.left, names, folder), *_texts(node.right, names, folder)]
        return _joined("", [node.left, node.right], names, folder)
    if isinstance(node, ast.Call):
        called: Any = node.func
        name = getattr(called, "attr", getattr(called, "id", ""))
        if name == "join":
            return _joined("/", node.args, names, folder)
        if name == "glob" and node.args:
            pattern = "".join(_texts(node.args[0], names, folder)[:1])
            try:
                return [str(path.relative_to(folder)) for path in sorted(folder.glob(pattern))] if pattern else []
            except (NotImplementedError, ValueError):
                return []
    return []


def _joined(by: str, parts: list[ast.expr], names: dict[str, str], folder: Path) -> list[str]:
    texts = [_texts(part, names, folder) for part in parts]
    return [by.join(text[0] for text in texts)] if all(len(text) == 1 for text in texts) else []
