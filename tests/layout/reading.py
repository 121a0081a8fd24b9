"""What the layout tests look at in a module, each parsed once: a parser's time is felt in two thousand files."""

from __future__ import annotations

import ast
import functools
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

__all__ = ["PACKAGES", "ROOT", "Shape", "shape", "sources"]

ROOT = Path(__file__).resolve().parents[2]
PACKAGES = ("metaros", "edge_agent", "gateway")


@dataclass(frozen=True, slots=True)
class Shape:
    """The functions of a module (line, name, how many lines), and its public names that have no docstring."""

    functions: tuple[tuple[int, str, int], ...]
    bare: tuple[str, ...]


def sources(*folders: str) -> list[Path]:
    """Every Python file we wrote under the given folders."""
    return sorted(
        path
        for folder in folders
        for path in (ROOT / folder).rglob("*.py")
        if "_proto" not in path.parts and "node_modules" not in path.parts
    )


@functools.cache
def shape(path: Path) -> Shape:
    """Of a module."""
    tree = ast.parse(path.read_text())
    return Shape(tuple(_functions(tree)), tuple(_bare(tree, str(path.relative_to(ROOT)))))


def _functions(block: ast.AST) -> Iterator[tuple[int, str, int]]:
    for part in ("body", "orelse", "finalbody", "handlers", "cases"):
        for node in getattr(block, part, ()):
            if isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef):
                yield node.lineno, node.name, (node.end_lineno or node.lineno) - node.lineno + 1
            yield from _functions(node)


def _bare(tree: ast.Module, name: str) -> Iterator[str]:
    if tree.body and ast.get_docstring(tree) is None:
        yield name
    for node in tree.body:
        named = isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef | ast.ClassDef)
        if named and not node.name.startswith("_") and ast.get_docstring(node) is None:
            yield f"{name}:{node.lineno} {node.name}"
