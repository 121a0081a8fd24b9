"""The gateway under load: a process of its own, started, killed, started again, and asked how it is."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
import time
from collections.abc import Sequence
from pathlib import Path
from typing import Any, Final

from load_tests.benchmarks.gateway.ingest import GATEWAY
from load_tests.fleet.figures import Probe
from tests.support.ports import free_port
from tests.support.processes.fork_server import Forked

__all__ = ["GatewayProcess"]

START_S: Final = 60.0


class GatewayProcess:
    """One gateway on ports that stay the same over its lives, with its defaults for all that `options` do not say.

    A `warm` one is forked off a server that has imported everything: for tests, not for figures of memory or starts.
    """

    def __init__(
        self, folder: Path, options: Sequence[str] = (), *, core: int | None = None, warm: bool = False
    ) -> None:
        self.folder = folder
        self.data_dir = folder / "data"
        self.http_port, self.grpc_port = free_port(), free_port()
        self.starts = 0
        self._options = list(options)
        self._core = core
        self._warm = warm
        self._process: subprocess.Popen[bytes] | Forked | None = None

    @property
    def pid(self) -> int:
        """Of the life that runs, or ran last."""
        return self._process.pid if self._process is not None else 0

    @property
    def running(self) -> bool:
        """Whether it lives."""
        return self._process is not None and self._process.poll() is None

    def start(self) -> Probe:
        """Start it and wait until it serves."""
        status = self.folder / "status.json"
        status.unlink(missing_ok=True)
        command = ["gateway", "--port", str(self.http_port)]
        command += ["--grpc-port", str(self.grpc_port), "--api-grpc-port", "0"]
        command += ["--foxglove-port", "off", "--rosbridge-port", "off", "--data-dir", str(self.data_dir)]
        command += ["--status-file", str(status), *self._options]
        with open(self.folder / "gateway.log", "ab") as log:
            environment = {**os.environ, "GRPC_VERBOSITY": "ERROR"}
            if self._warm:
                self._process = Forked(command, output=log.fileno(), env=environment)
            else:
                cold = [sys.executable, "-c", GATEWAY, *command]
                self._process = subprocess.Popen(cold, stdout=log, stderr=log, env=environment)
        if self._core is not None:
            os.sched_setaffinity(self._process.pid, {self._core})
        self.starts += 1
        end_s = time.monotonic() + START_S
        while not status.exists():
            if self._process.poll() is not None or time.monotonic() > end_s:
                raise RuntimeError(f"the gateway did not start: {self.log_tail()}")
            time.sleep(0.02)
        while not (text := status.read_text()).strip():
            time.sleep(0.01)
        self.status: dict[str, Any] = json.loads(text)
        return Probe(self._process.pid)

    def kill(self, number: int = signal.SIGKILL) -> None:
        """A signal to it."""
        if self.running and self._process is not None:
            self._process.send_signal(number)
            if number == signal.SIGKILL:
                self._process.wait()

    def stop(self, *, timeout_s: float = 60.0) -> None:
        """End it well; after so long not so well."""
        if self._process is None or self._process.poll() is not None:
            return
        self._process.send_signal(signal.SIGCONT)
        self._process.terminate()
        try:
            self._process.wait(timeout_s)
        except subprocess.TimeoutExpired:
            self._process.kill()
            self._process.wait()

    def log_tail(self) -> str:
        """The last lines that it wrote."""
        path = self.folder / "gateway.log"
        return "\n".join(path.read_text(errors="replace").splitlines()[-8:]) if path.exists() else ""
