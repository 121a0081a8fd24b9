"""`metaros …` in this process, which saves each call the start of an interpreter; `program` for a real process."""

from __future__ import annotations

import asyncio
import io
import os
import signal
import sys
import threading
from collections.abc import Callable, Iterator, Mapping
from contextlib import ExitStack, contextmanager, redirect_stderr, redirect_stdout, suppress
from pathlib import Path
from typing import NamedTuple, TextIO

from metaros.cli.main import main
from tests.support.waiting import wait_until

__all__ = ["Done", "ask_metaros", "call_metaros", "program", "run_metaros", "stop_metaros", "stream_metaros"]

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


def stop_metaros(
    *arguments: str, when: Callable[[str], object], by: signal.Signals = signal.SIGINT, **environ: str
) -> Done:
    """A command that goes on until a signal ends it, which comes once `when(what it has printed)` is true.

    Call it in the main thread, where signals are handled, and for commands that handle them.
    """
    out, err, over = io.BytesIO(), io.BytesIO(), threading.Event()
    faults: list[BaseException] = []

    def watch() -> None:
        try:
            wait_until(lambda: over.is_set() or when(out.getvalue().decode()))
        except BaseException as fault:
            faults.append(fault)
        signal.pthread_kill(threading.main_thread().ident or 0, by)

    watcher = threading.Thread(target=watch)
    with _ONE_AT_A_TIME, _surroundings({"NO_COLOR": "1", "COLUMNS": "80", **environ}, None, ""):
        before = signal.signal(by, lambda *_: None)  # where it comes after the command's own end
        watcher.start()
        try:
            with _written(out) as stdout, _written(err) as stderr, redirect_stdout(stdout), redirect_stderr(stderr):
                code = _exit_code(arguments)
        finally:
            over.set()
            watcher.join()
            signal.signal(by, before)
    for fault in faults:
        raise fault
    return Done(code, out.getvalue().decode(), err.getvalue().decode())


@contextmanager
def stream_metaros(*arguments: str, **environ: str) -> Iterator[TextIO]:
    """What a command prints, as it comes; who has read enough leaves, which has to end the command without a word."""
    err, codes = io.BytesIO(), list[int]()
    with ExitStack() as stack:
        stack.enter_context(_ONE_AT_A_TIME)
        stack.enter_context(_surroundings({"NO_COLOR": "1", "COLUMNS": "80", **environ}, None, ""))
        reader, writer = (os.fdopen(end, mode) for end, mode in zip(os.pipe(), "rw", strict=True))
        stack.enter_context(redirect_stdout(writer))
        stack.enter_context(redirect_stderr(stack.enter_context(_written(err))))
        thread = threading.Thread(target=lambda: codes.append(_exit_code(arguments)))
        thread.start()
        try:
            with reader:
                yield reader
                said = err.getvalue()
        finally:
            thread.join()
            with suppress(BrokenPipeError):  # what it had not written yet
                writer.close()
    assert codes in ([0], [1])
    assert err.getvalue() == said


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
