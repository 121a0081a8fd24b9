"""Which tests reach a fault: from coverage.py's data, whose contexts are the names of test files.

    python -m load_tests.mutations.select --tree DIR --data FILE... --out TESTS_OF.json

Reads coverage's SQLite files as they are, one or many (no `combine` needed), with arcs (`branch = true`). A file under
another folder than the tree fits by the end of its path.
"""

from __future__ import annotations

import argparse
import ast
import json
import re
import sqlite3
import sys
from collections import Counter, defaultdict
from collections.abc import Iterable, Sequence
from contextlib import closing
from pathlib import Path

from load_tests.mutations.closeness import by_closeness, mirror_rank
from load_tests.mutations.faults import Mutation, TreeError, line_of, read_mutations

__all__ = ["Reached", "lines_of", "main", "selected"]

_TEST = re.compile(r"(tests/[^|:]*\.py)")
_ARCS = """
    SELECT c.context, a.tono FROM arc a JOIN file f ON f.id = a.file_id JOIN context c ON c.id = a.context_id
    WHERE f.path LIKE ? AND a.tono > 0
"""
_SIZES = "SELECT c.context, count(*) FROM arc a JOIN context c ON c.id = a.context_id GROUP BY c.context"


class Reached:
    """Of the files asked for: which test files reach which lines; and how much each test file reaches in all."""

    def __init__(self, data: Iterable[Path], files: Sequence[str]) -> None:
        self.lines: dict[str, dict[int, set[str]]] = {file: defaultdict(set) for file in files}
        self.sizes: Counter[str] = Counter()
        self.skipped = 0  # data files that cannot be read, or are not whole yet
        for path in data:
            try:
                self._read(path)
            except sqlite3.Error:
                self.skipped += 1

    def _read(self, path: Path) -> None:
        with closing(sqlite3.connect(f"file:{path}?mode=ro", uri=True)) as store:
            for context, count in store.execute(_SIZES):
                for test in _TEST.findall(context):
                    self.sizes[test] += count
            for file, lines in self.lines.items():
                for context, line in store.execute(_ARCS, (f"%/{file}",)):
                    lines[line].update(_TEST.findall(context))


def lines_of(source: str, line: int) -> range | None:
    """The lines whose run shows that the statement on this one ran; None for one that runs at import alone."""
    nodes = (node for node in ast.walk(ast.parse(source)) if isinstance(node, ast.stmt | ast.ExceptHandler))
    within = [node for node in nodes if node.lineno <= line <= (node.end_lineno or node.lineno)]
    functions = [node for node in within if isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef)]
    statement = max(within, key=lambda node: (node.lineno, -(node.end_lineno or 0)), default=None)
    if statement is None or not functions or statement in functions:
        return None
    body = getattr(statement, "body", None)
    end = body[0].lineno - 1 if body else statement.end_lineno or line
    return range(statement.lineno, max(end, statement.lineno) + 1)


def selected(fault: Mutation, tree: Path, reached: Reached) -> list[str]:
    """The test files that reach a fault: its mirror first, then those that reach the least."""
    if not fault.file.endswith(".py"):
        return by_closeness(fault.file, tree)
    lines = lines_of((tree / fault.file).read_text("utf-8"), line_of(fault, tree))
    known = reached.lines[fault.file]
    tests = set().union(*(known.get(line, ()) for line in (lines if lines is not None else list(known))))
    return sorted(tests, key=lambda test: (mirror_rank(fault.file, test) > 0, reached.sizes[test], test))


def main(argv: list[str] | None = None) -> int:
    """Write the selection; exit code 1 when some fault is reached by no test."""
    parser = argparse.ArgumentParser(prog="python -m load_tests.mutations.select")
    parser.add_argument("--tree", type=Path, required=True, help="the tree that the data is of")
    parser.add_argument("--data", type=Path, nargs="+", required=True, help="coverage's data files")
    parser.add_argument("--out", type=Path, required=True)
    options = parser.parse_args(argv)
    faults = read_mutations()
    reached = Reached(options.data, sorted({fault.file for fault in faults if fault.file.endswith(".py")}))
    if reached.skipped:
        print(f"{reached.skipped} of {len(options.data)} data files cannot be read", file=sys.stderr)
    tests_of: dict[str, list[str]] = {}
    for fault in faults:
        try:
            tests_of[fault.id] = selected(fault, options.tree.resolve(), reached)
        except TreeError as error:
            print(f"left out: {error}", file=sys.stderr)
    options.out.write_text(json.dumps(tests_of, indent=1) + "\n")
    bare = [key for key, tests in tests_of.items() if not tests]
    for fault in faults:
        print(f"{fault.id}  {len(tests_of.get(fault.id, ())):4} test files  {fault.file}")
    print(f"no test reaches {', '.join(bare)}" if bare else "every fault is reached by a test")
    return 1 if bare else 0


if __name__ == "__main__":
    sys.exit(main())
