"""Runs the ```console blocks of a page, and compares what they print with the sample on the page by its shape.

`$ command` is run: `metaros …` in this process, everything else by the shell, and also what lists the types that the
process knows, for this one knows those of other tests. `… &` stays until the page's end. After a `^C` line the program
before it gets a Ctrl-C. Samples: a number stands for any number, `…` for anything, and a line of its own `…` for any
lines.
"""

from __future__ import annotations

import io
import os
import re
import shlex
import signal
import subprocess
import sys
from collections.abc import Iterator, Sequence
from contextlib import ExitStack, contextmanager, redirect_stderr, redirect_stdout
from dataclasses import dataclass, field, replace
from pathlib import Path

from metaros.cli.main import main
from metaros.wire import Graph, WireSession
from tests.support.ports import free_port
from tests.support.waiting import wait_until

__all__ = ["Command", "World", "commands_of", "environment", "matches"]

NUMBER = re.compile(r"(?<![\w/.])-?\d+(?:\.\d+)?(?:e[+-]?\d+)?(?![\w])")
UNIT = re.compile(r"\b[kM]?B\b")
STYLE = re.compile(r"\x1b\[[0-9;]*m")
SHELL = re.compile(r"[|>$`;*]|^(?!metaros )|^metaros interface (list|package)")
QUOTED = re.compile(r"'[^']*'|\"[^\"$`]*\"")  # in which nothing is the shell's
INTO = re.compile(r"^(metaros [^|>$`;*]+) > ([\w.]+)$")


@dataclass
class Command:
    """One command of a page, and the sample of what it prints."""

    line: int
    text: str
    sample: list[str] = field(default_factory=list)

    @property
    def stays(self) -> bool:
        """Whether it runs until the page's end."""
        return self.text.endswith("&")

    @property
    def interrupted(self) -> bool:
        """Whether it is ended by Ctrl-C."""
        return "^C" in self.sample


def commands_of(page: str) -> list[Command]:
    """All commands of the console blocks of a page."""
    found: list[Command] = []
    inside = False
    for number, line in enumerate(page.splitlines(), start=1):
        if line.startswith("```"):
            inside = line == "```console"
        elif inside and line.startswith("$ "):
            found.append(Command(number, line[2:]))
        elif inside:
            found[-1].sample.append(line)
    return found


def matches(sample: list[str], printed: str) -> bool:
    """Whether an output looks like its sample."""
    wanted = [None if line == "…" else _line(line) for line in sample]
    lines = [_plain(line) for line in printed.rstrip().splitlines()]
    reached = {0}  # how many lines the sample so far can account for
    for pattern in wanted:
        if pattern is None:
            reached = set(range(min(reached, default=len(lines) + 1), len(lines) + 1))
        else:
            reached = {n + 1 for n in reached if n < len(lines) and pattern.fullmatch(lines[n])}
    return len(lines) in reached


def _line(line: str) -> re.Pattern[str]:
    pieces = []
    for text in _plain(line).split("…"):
        first, *rest = [UNIT.sub("[kM]?B", re.escape(part)) for part in NUMBER.split(text)]
        pieces.append(first + "".join(rf"(?:–|-?\d+(?:\.\d+)?(?:e[+-]?\d+)?){part}" for part in rest))
    return re.compile(".*".join(pieces))


def _plain(line: str) -> str:
    """Columns are as wide as what is in them: any space is one space, any rule is one dash."""
    return re.sub(r"─+", "─", " ".join(line.split()))


class Terminal(io.StringIO):
    """Standard output that calls itself a terminal."""

    def isatty(self) -> bool:
        """Tables, please."""
        return True


@dataclass
class World:
    """A router, a place to work in, and whatever the page has started."""

    endpoint: str
    folder: Path
    metaros: Sequence[str] = (sys.executable, "-u", "-m", "metaros")
    programs: list[subprocess.Popen[bytes]] = field(default_factory=list)
    ports: dict[str, str] = field(default_factory=dict)

    @contextmanager
    def page(self) -> Iterator[None]:
        """What a page starts ends with it."""
        with ExitStack() as stack:
            self._session = WireSession(connect=self.endpoint)
            stack.callback(self._session.close)
            self._graph = Graph(self._session)
            stack.callback(self._graph.close)
            try:
                yield
            finally:
                self._end(self.programs)
                self.programs.clear()

    def run(self, command: Command) -> str:
        """Do it; what it printed. Ports that a page names may be taken here: each gets another number."""
        for port in re.findall(r"\b80\d\d\b", command.text):
            self.ports.setdefault(port, str(free_port()))
        command = replace(command, text=re.sub(r"\b80\d\d\b", lambda found: self.ports[found[0]], command.text))
        if command.stays:
            return self._start(command)
        if command.interrupted:
            return self._interrupt(command)
        into = INTO.match(QUOTED.sub(lambda quoted: "x" * len(quoted[0]), command.text))
        if into:
            (self.folder / into[2]).write_text(self._call(command.text[: into.end(1)], io.StringIO(), command.sample))
            return ""
        if SHELL.search(QUOTED.sub("", command.text)):
            return self._shell(command)
        return self._call(command.text, Terminal(), command.sample)

    @staticmethod
    def _call(text: str, printed: io.StringIO, sample: list[str]) -> str:
        """In this process; what it printed, without colours."""
        code: object = 0
        with redirect_stdout(printed), redirect_stderr(printed):
            try:
                main(shlex.split(text)[1:])
            except SystemExit as ended:
                code = ended.code
        ends_well = not any(line.startswith(("error: ", "✗")) for line in sample)
        assert not sample or (code in (0, None)) == ends_well, f"exit code {code}:\n{printed.getvalue()}"
        return STYLE.sub("", printed.getvalue())

    def _shell(self, command: Command) -> str:
        done = subprocess.run(
            ["bash", "-c", command.text], stdout=-1, stderr=-2, text=True, cwd=self.folder, timeout=60
        )
        assert done.returncode == 0, done.stdout
        return done.stdout

    def _popen(self, command: Command, log: Path) -> subprocess.Popen[bytes]:
        words = shlex.split(command.text.rstrip("& "))
        first = {"metaros": self.metaros, "python": (sys.executable, "-u")}[words[0]]
        with log.open("wb") as out:
            return subprocess.Popen([*first, *words[1:]], stdout=out, stderr=out, cwd=self.folder)

    def _start(self, command: Command) -> str:
        """In the background; ready when it has printed the sample, or else when its nodes are in the graph."""
        before = len(self._graph.endpoints())
        log = self.folder / f"{command.line}.log"
        self.programs.append(self._popen(command, log))
        if command.sample:
            wait_until(lambda: matches(command.sample, log.read_text()), timeout_s=60)
        else:
            wait_until(lambda: len(self._graph.endpoints()) > before)
        size = [0, -1]

        def settled() -> bool:
            size.append(len(self._graph.endpoints()))
            return len(set(size[-3:])) == 1

        wait_until(settled, every_s=0.1)
        return log.read_text() if command.sample else ""

    def _interrupt(self, command: Command) -> str:
        log = self.folder / f"{command.line}.log"
        cut = command.sample.index("^C")
        process = self._popen(command, log)
        try:
            wait_until(lambda: matches([*command.sample[:cut], "…"], log.read_text()), timeout_s=60)
        except AssertionError:
            raise AssertionError(f"{command.text} printed:\n{log.read_text()}") from None
        finally:
            self._end([process])
        return log.read_text()

    @staticmethod
    def _end(programs: list[subprocess.Popen[bytes]]) -> None:
        for process in programs:
            if process.poll() is None:
                process.send_signal(signal.SIGINT)
        for process in programs:
            try:
                process.wait(20)
            except subprocess.TimeoutExpired:
                process.kill()
                process.wait(10)


def environment(endpoint: str, folder: Path) -> dict[str, str]:
    """So that a page's commands, written for the usual ports, find the test's router, and leave nothing elsewhere."""
    return {
        "METAROS_ZENOH_PORT": endpoint.rsplit(":", 1)[1],
        "METAROS_RUNTIME_DIR": str(folder / "run"),
        "XDG_DATA_HOME": str(folder / "data"),
        "HOME": str(folder),  # agents keep their state there
        "NO_COLOR": "1",
        "COLUMNS": "110",
        "PATH": f"{Path(sys.executable).parent}{os.pathsep}{os.environ['PATH']}",
    }
