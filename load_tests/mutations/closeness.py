"""Which test files are near a module: its mirror first, then who imports it, then who imports who imports it."""

from __future__ import annotations

import ast
import functools
import sys
from collections import deque
from collections.abc import Iterable
from pathlib import Path
from typing import Any

__all__ = ["by_closeness", "mirror_rank"]

PACKAGES = ("metaros", "edge_agent", "gateway")
FAR = 99


def mirror_rank(file: str, test: str) -> int:
    """0 for the test file in the module's own place, 1 for others of its folder, 2 for the rest."""
    folder, _, name = file.rpartition("/")
    stem = Path(name).stem.lstrip("_")
    if test == f"tests/{folder}/test_{stem}.py":
        return 0
    return 1 if test.rpartition("/")[0] in (f"tests/{folder}", f"tests/{folder}/{stem}") else 2


def by_closeness(file: str, tree: Path) -> list[str]:
    """The test files that can have to do with a file, the nearest first."""
    tests = [path.relative_to(tree).as_posix() for path in sorted((tree / "tests").rglob("test_*.py"))]
    if file.startswith("deploy/"):
        return [test for test in tests if test.startswith("tests/deploy/")]
    if file.startswith("dashboard/"):
        pages = [test for test in tests if _mentions(tree / test, "open_page", "browser")]
        return sorted(pages, key=lambda test: (not test.startswith("tests/e2e/"), test))
    steps = _distances(file.removesuffix(".py").removesuffix("/__init__").replace("/", "."), tree)
    ranked = [(mirror_rank(file, test), _far(tree / test, tree, steps), test) for test in tests]
    return [test for rank, far, test in sorted(ranked) if rank < 2 or far < FAR]


def _mentions(path: Path, *words: str) -> bool:
    text = path.read_text("utf-8")
    return any(word in text for word in words)


@functools.cache
def _graph(tree: Path) -> Any:
    import grimp  # comes with import-linter

    sys.path.insert(0, str(tree))  # before what is installed here
    try:
        return grimp.build_graph(*PACKAGES, cache_dir=None)
    finally:
        sys.path.remove(str(tree))


def _distances(module: str, tree: Path) -> dict[str, int]:
    """How many imports lie between each module and this one."""
    graph, found, queue = _graph(tree), {module: 0}, deque([module])
    while queue:
        near = queue.popleft()
        for far in graph.find_modules_that_directly_import(near) if near in graph.modules else ():
            if far not in found:
                found[far] = found[near] + 1
                queue.append(far)
    return found


def _far(test: Path, tree: Path, steps: dict[str, int]) -> int:
    """Of a test file: what it imports itself or by the helpers it imports; its folders' conftest are a step more."""
    own = _least(_reach(test, tree), steps)
    above = [folder / "conftest.py" for folder in test.parents if folder.is_relative_to(tree / "tests")]
    shared = min((_least(_reach(path, tree), steps) for path in above if path.is_file()), default=FAR)
    return min(own, shared + 1)


def _least(modules: Iterable[tuple[str, int]], steps: dict[str, int]) -> int:
    return min((steps[name] + more for name, more in modules if name in steps), default=FAR)


@functools.cache
def _reach(path: Path, tree: Path) -> tuple[tuple[str, int], ...]:
    """First-party modules that a file imports, and those that helpers under `tests` import for it, a step further."""
    found: dict[str, int] = {}
    queue, seen = deque([(path, 0)]), {path}
    while queue:
        file, step = queue.popleft()
        for name in _imports(file):
            found[name] = min(step, found.get(name, step))
            helper = tree / f"{name.replace('.', '/')}.py"
            if name.startswith("tests.") and helper.is_file() and helper not in seen:
                seen.add(helper)
                queue.append((helper, step + 1))
    return tuple(found.items())


@functools.cache
def _imports(path: Path) -> frozenset[str]:
    """The names in its import statements: a module's, or something's in a module."""
    found: set[str] = set()
    for node in ast.walk(ast.parse(path.read_text("utf-8"))):
        if isinstance(node, ast.Import):
            found.update(alias.name for alias in node.names)
        elif isinstance(node, ast.ImportFrom) and node.module:
            found.add(node.module)
            found.update(f"{node.module}.{alias.name}" for alias in node.names)
    return frozenset(found)
