"""What the layout tests look at in a module; a parser's time is felt in two thousand files, so few are parsed."""

from __future__ import annotations

import ast
import subprocess
from collections.abc import Iterator
from importlib.machinery import SourceFileLoader
from inspect import CO_OPTIMIZED
from pathlib import Path
from types import CodeType

__all__ = ["PACKAGES", "ROOT", "functions", "may_be_longer", "sources", "tracked"]

ROOT = Path(__file__).resolve().parents[2]
PACKAGES = ("metaros", "edge_agent", "gateway")


def sources(*folders: str) -> list[Path]:
    """Every Python file we wrote under the given folders."""
    return sorted(
        path
        for folder in folders
        for path in (ROOT / folder).rglob("*.py")
        if "_proto" not in path.parts and "node_modules" not in path.parts
    )


def tracked() -> list[str]:
    """Files git knows."""
    listed = subprocess.run(["git", "ls-files", "-z"], cwd=ROOT, capture_output=True, text=True, check=True)
    return [name for name in listed.stdout.split("\0") if name]


def may_be_longer(path: Path, lines: int) -> bool:
    """Whether a function of the module could be: by its bytecode, which is there once it has been imported.

    That leaves out what makes no code at a function's end, such as `pass`: what has half of the lines is suspected.
    """
    return any(span > lines // 2 for span in _spans(SourceFileLoader(path.stem, str(path)).get_code(path.stem)))


def _spans(code: CodeType | None) -> Iterator[int]:
    """The lines of each function in the code, decorators included."""
    for inner in code.co_consts if code is not None else ():
        if isinstance(inner, CodeType):
            if inner.co_flags & CO_OPTIMIZED:  # a function, no class
                yield max((line for *_, line in inner.co_lines() if line), default=0) - inner.co_firstlineno + 1
            yield from _spans(inner)


def functions(block: ast.AST) -> Iterator[tuple[int, str, int]]:
    """Line, name, and how many lines, of each one in it."""
    for part in ("body", "orelse", "finalbody", "handlers", "cases"):
        for node in getattr(block, part, ()):
            if isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef):
                yield node.lineno, node.name, (node.end_lineno or node.lineno) - node.lineno + 1
            yield from functions(node)
