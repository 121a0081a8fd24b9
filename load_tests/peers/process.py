"""A child process of a pair: started under its peer's Python, spoken to by lines, never left behind."""

from __future__ import annotations

import json
import queue
import subprocess
import tempfile
import threading
from contextlib import suppress
from pathlib import Path
from typing import Any

__all__ = ["PeerFailed", "PeerProcess"]

_ROOT = Path(__file__).resolve().parents[2]
# The tree comes last in sys.path: the environment's own `metaros` and `zmq` are meant, not this tree's.
_START = f"import sys; sys.path.append({str(_ROOT)!r}); from load_tests.peers.role import main; main(sys.argv[1:])"
_SHOWN = 300


class PeerFailed(Exception):
    """A peer's process said an error, died, or said nothing in time."""


class PeerProcess:
    """One role of one peer. Use it as a context manager."""

    def __init__(self, python: str, job: dict[str, Any]) -> None:
        self._name = f"{job['module']} {job['role']}"
        self._errors = tempfile.TemporaryFile("w+", errors="replace")  # noqa: SIM115 - closed in __exit__
        self._popen = subprocess.Popen(
            [python, "-P", "-c", _START, json.dumps(job)],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=self._errors,
            text=True,
            cwd=job["scratch"],
        )
        self.pid = self._popen.pid
        self._lines: queue.SimpleQueue[str] = queue.SimpleQueue()
        self._reader = threading.Thread(target=self._read, daemon=True)
        self._reader.start()

    def tell(self, command: str = "") -> None:
        """One line to the process."""
        assert self._popen.stdin is not None
        try:
            self._popen.stdin.write(command + "\n")
            self._popen.stdin.flush()
        except OSError:
            raise PeerFailed(self._complaint("is gone")) from None

    def answer(self, *, timeout_s: float = 30.0) -> Any:
        """The next thing that the process says."""
        try:
            line = self._lines.get(timeout=timeout_s)
        except queue.Empty:
            raise PeerFailed(self._complaint(f"said nothing for {timeout_s:g} s")) from None
        if not line:
            raise PeerFailed(self._complaint("ended"))
        value = json.loads(line)
        if isinstance(value, dict) and "error" in value:
            raise PeerFailed(f"{self._name}: {value['error']}")
        return value

    def ask(self, command: str = "", *, timeout_s: float = 30.0) -> Any:
        """Tell, and wait for the answer."""
        self.tell(command)
        return self.answer(timeout_s=timeout_s)

    def _read(self) -> None:
        assert self._popen.stdout is not None
        for line in self._popen.stdout:
            self._lines.put(line)
        self._lines.put("")

    def _complaint(self, what: str) -> str:
        self._errors.seek(0)
        last = self._errors.read().strip().splitlines()[-1:]
        return ": ".join([f"{self._name} {what}", *(line[:_SHOWN] for line in last)])

    def __enter__(self) -> PeerProcess:
        return self

    def __exit__(self, *_: object) -> None:
        self._popen.kill()
        self._popen.wait()
        self._reader.join()
        for stream in (self._popen.stdin, self._popen.stdout, self._errors):
            if stream is not None:
                with suppress(OSError):  # what it was not told any more
                    stream.close()
