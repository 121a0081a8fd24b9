"""The real programs as processes: what a test starts here is what a user starts from the command line.

Their imports are paid for once, see `warm`; tests of `metaros up` and of the wheel show that they start without it.
"""

from __future__ import annotations

import json
import os
import signal
import urllib.error
import urllib.request
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from gateway.identity.local_key import LOCAL_KEY_FILE
from metaros.wire import Router, open_router
from tests.support.ports import free_port
from tests.support.processes.fork_server import Forked
from tests.support.processes.processes import END_S, end
from tests.support.waiting import wait_until

__all__ = ["Program", "Stack"]


@dataclass
class Program:
    """One running `metaros …` process."""

    name: str
    process: Forked
    log: Path
    arguments: list[str]
    status_file: Path | None = None

    @property
    def output(self) -> str:
        """Everything it printed so far."""
        return self.log.read_text(errors="replace")

    def kill(self) -> None:
        """kill -9, and reap."""
        self.process.kill()
        self.process.wait(END_S)


@dataclass
class Stack:
    """A robot's side and a gateway on free loopback ports, all files under `folder`; use as a context manager."""

    folder: Path
    zenoh_port: int = field(default_factory=free_port)
    http_port: int = field(default_factory=free_port)
    grpc_port: int = field(default_factory=free_port)
    programs: list[Program] = field(default_factory=list)
    data: Path | None = None  # of the gateway; another stack's where its gateway is shared
    _router: Router | None = None

    def __enter__(self) -> Stack:
        return self

    def __exit__(self, *_exc: object) -> None:
        for program in reversed(self.programs):
            if program.process.poll() is None:
                program.process.send_signal(signal.SIGINT)
        for program in reversed(self.programs):
            end(program.process)
        if self._router is not None:
            self._router.close()

    @property
    def url(self) -> str:
        """Where the gateway serves HTTP."""
        return f"http://127.0.0.1:{self.http_port}"

    @property
    def key(self) -> str:
        """The gateway's key for whoever can read its data directory: of an administrator, until it ends."""
        return (self.data_dir / LOCAL_KEY_FILE).read_text().strip()

    @property
    def data_dir(self) -> Path:
        """The gateway's."""
        return self.data or self.folder / "data"

    def beside(self, folder: Path) -> Stack:
        """Other robots of this gateway: by other names, on a router of their own."""
        return Stack(folder, http_port=self.http_port, grpc_port=self.grpc_port, data=self.data_dir)

    def start(self, name: str, *arguments: str, ready: bool = True, timeout_s: float = 120.0) -> Program:
        """Start `metaros ARGUMENTS`; with `ready`, wait for its status file."""
        log, status = self.folder / f"{name}.log", self.folder / f"{name}.json"
        status.unlink(missing_ok=True)
        full = [*arguments, "--status-file", str(status)] if ready else list(arguments)
        with log.open("ab") as out:
            env = {**os.environ, "METAROS_ZENOH_PORT": str(self.zenoh_port)}
            process = Forked(full, output=out.fileno(), env=env)
        program = Program(name, process, log, list(arguments), status if ready else None)
        self.programs.append(program)
        if ready:
            wait_until(lambda: status.exists() or process.poll() is not None, timeout_s=timeout_s)
            assert process.poll() is None, f"{name} ended with {process.returncode}:\n{program.output}"
        return program

    def at_once(self, *starts: Callable[[], Program]) -> list[Program]:
        """What these start, beside each other."""
        with ThreadPoolExecutor(len(starts)) as pool:
            return [future.result() for future in [pool.submit(start) for start in starts]]

    def restart(self, program: Program) -> Program:
        """The same command again, as a supervisor would."""
        self.programs.remove(program)
        return self.start(program.name, *program.arguments)

    def router(self) -> None:
        """The robot's Zenoh router, in this process."""
        self._router = open_router(self.zenoh_port)

    def router_program(self) -> Program:
        """The same as a program, whose threads are enough for floods that may block."""
        return self.start("router", "router", "--port", str(self.zenoh_port))

    def gateway(self, *options: str) -> Program:
        """A gateway with a data directory of its own."""
        ports = ("--port", str(self.http_port), "--grpc-port", str(self.grpc_port))
        return self.start(
            "gateway", "gateway", "--host", "127.0.0.1", *ports, "--data-dir", str(self.data_dir), *options
        )

    def agent(self, name: str, *options: str, namespace: str = "") -> Program:
        """The agent of robot `name`, in namespace /`name` or another; its state directory outlives a restart."""
        where = ("--gateway", f"127.0.0.1:{self.grpc_port}", "--zenoh-port", str(self.zenoh_port))
        where += ("--state-dir", str(self.folder / f"agent-{name}"))
        return self.start(
            f"agent-{name}",
            "agent",
            "--name",
            name,
            "--namespace",
            namespace or f"/{name}",
            *where,
            "--no-host-metrics",
            *options,
        )

    def sim(self, *options: str, robots: int = 1) -> Program:
        """Simulated robots sim_1 … sim_N."""
        return self.start("sim", "sim", "--robots", str(robots), "--zenoh-port", str(self.zenoh_port), *options)

    def get(self, path: str) -> Any:
        """GET a JSON document, or None while there is nobody to answer."""
        try:
            with urllib.request.urlopen(self.url + path, timeout=30) as answer:
                return json.load(answer)
        except (urllib.error.URLError, ConnectionError, TimeoutError):
            return None

    def online(self) -> set[str]:
        """Names of the robots the gateway calls online."""
        answer = self.get("/api/v1/robots")
        return {robot["id"] for robot in answer["robots"] if robot["state"] == "online"} if answer else set()

    def topics(self, robot: str) -> dict[str, dict[str, Any]]:
        """What the gateway knows of a robot's topics, by name."""
        answer = self.get(f"/api/v1/robots/{robot}/topics")
        return {topic["topic"]: topic for topic in answer["topics"]} if answer else {}
