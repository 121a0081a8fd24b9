"""`metaros …` in this process, which saves each call the start of an interpreter; `program` for a real process."""

from __future__ import annotations

import asyncio
import io
import os
import sys
import threading
from collections.abc import Iterator, Mapping
from contextlib import contextmanager, redirect_stderr, redirect_stdout
from pathlib import Path
from typing import NamedTuple

from metaros.cli.main import main

__all__ = ["Done", "ask_metaros", "call_metaros", "program", "run_metaros"]

_ONE_AT_A_TIME = threading.Lock()  # output, environment and folder are the process's


class Done(NamedTuple):
    """How a command ended, and what it printed."""

    code: int
    out: str
    err: str


def program(*arguments: str) -> list[str]:
    """The command as a process: for signals, terminals, pipes, and what lives on."""
    return [sys.executable, "-m", "metaros", *arguments]


def call_metaros(*arguments: str, stdin: str = "", folder: Path | None = None, **environ: str) -> Done:
    """Run a command to its end, as a shell would that has no terminal; not from inside an event loop."""
    out, err = io.BytesIO(), io.BytesIO()
    with _ONE_AT_A_TIME, _surroundings({"NO_COLOR": "1", "COLUMNS": "80", **environ}, folder, stdin):
        with _written(out) as stdout, _written(err) as stderr, redirect_stdout(stdout), redirect_stderr(stderr):
            code = _exit_code(arguments)
    return Done(code, out.getvalue().decode(), err.getvalue().decode())


async def ask_metaros(*arguments: str, stdin: str = "", folder: Path | None = None, **environ: str) -> Done:
    """The same from inside an event loop, which goes on meanwhile."""
    return await asyncio.to_thread(call_metaros, *arguments, stdin=stdin, folder=folder, **environ)


def run_metaros(*arguments: str) -> str:
    """What it printed; it has to end well."""
    done = call_metaros(*arguments)
    assert done.code == 0, done.err
    return done.out


def _exit_code(arguments: tuple[str, ...]) -> int:
    try:
        main(arguments)
    except SystemExit as end:
        if isinstance(end.code, str):
            sys.stderr.write(f"{end.code}\n")
        return end.code if isinstance(end.code, int) else int(end.code is not None)
    return 0


@contextmanager
def _written(into: io.BytesIO) -> Iterator[io.TextIOWrapper]:
    text = io.TextIOWrapper(into, encoding="utf-8", write_through=True)
    try:
        yield text
    finally:
        text.detach()


@contextmanager
def _surroundings(environ: Mapping[str, str], folder: Path | None, stdin: str) -> Iterator[None]:
    before, was_in, read_from = dict(os.environ), Path.cwd(), sys.stdin
    os.environ.update(environ)
    sys.stdin = io.TextIOWrapper(io.BytesIO(stdin.encode()), encoding="utf-8")
    if folder is not None:
        os.chdir(folder)
    try:
        yield
    finally:
        sys.stdin = read_from
        os.chdir(was_in)
        os.environ.clear()
        os.environ.update(before)
