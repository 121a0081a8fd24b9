"""The list of faults, and one of them put into a tree for a while: whatever happens, the file is put back."""

from __future__ import annotations

import os
import subprocess
import tomllib
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

__all__ = ["KINDS", "LIST", "Mutation", "TreeError", "line_of", "mutated", "read_mutations"]

LIST = Path(__file__).with_name("mutations.toml")
KINDS = ("logic", "ordering", "timeout", "limit", "permission", "fault-handling")


class TreeError(Exception):
    """The tree cannot take this mutation as it is."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Mutation:
    """One fault: in `file`, the one place that reads `old` reads `new`. `why` says what a user would suffer."""

    id: str
    file: str
    old: str
    new: str
    kind: str
    why: str

    @property
    def package(self) -> str:
        """The top folder: metaros, edge_agent, gateway, dashboard or deploy."""
        return self.file.partition("/")[0]


def read_mutations(path: Path = LIST) -> list[Mutation]:
    """All of them, in the list's order."""
    return [Mutation(**row) for row in tomllib.loads(path.read_text("utf-8"))["mutation"]]


def line_of(mutation: Mutation, tree: Path) -> int:
    """The line, from 1, on which the fault is to be. Raises TreeError where the code has moved on."""
    text = _text(mutation, tree)
    return text.count("\n", 0, text.index(mutation.old)) + 1


@contextmanager
def mutated(mutation: Mutation, tree: Path) -> Iterator[None]:
    """The tree with the fault in it. Raises TreeError where the file is not as committed, or has no such place."""
    path = tree / mutation.file
    text = _text(mutation, tree)
    status = subprocess.run(
        ["git", "status", "--porcelain", "--", mutation.file], cwd=tree, capture_output=True, text=True, check=True
    )
    if status.stdout:
        raise TreeError(f"{mutation.id}: {mutation.file} is not as it was committed: {status.stdout.strip()}")
    before, data = path.stat(), path.read_bytes()
    try:
        path.write_bytes(text.replace(mutation.old, mutation.new).encode())
        if int(path.stat().st_mtime) == int(before.st_mtime):  # .pyc files are told apart by whole seconds and size
            os.utime(path, (before.st_atime, before.st_mtime + 1))
        yield
    finally:
        path.write_bytes(data)
        os.utime(path, ns=(before.st_atime_ns, before.st_mtime_ns))


def _text(mutation: Mutation, tree: Path) -> str:
    path = tree / mutation.file
    if not path.is_file():
        raise TreeError(f"{mutation.id}: there is no {mutation.file} any more: take the mutation along by hand")
    text = path.read_bytes().decode()
    if (count := text.count(mutation.old)) != 1:
        raise TreeError(
            f"{mutation.id}: {mutation.file} has {count} times {mutation.old!r}, not once: the code has moved on"
        )
    return text
