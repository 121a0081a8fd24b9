"""A robot and a gateway as processes that a campaign kills, stops and starts; everything in one folder.

The processes come from a fork server that has imported everything already, so that a start takes milliseconds and a
campaign of a thousand kills minutes. They are processes like any other: `kill -9` takes them.
"""

from __future__ import annotations

import json
import multiprocessing
import os
import signal
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

from tests.support.ports import free_port
from tests.support.robots.checker import Stored, Verdict, check, read_sqlite
from tests.support.robots.load_robot import RobotConfig, run_robot
from tests.support.robots.load_robot_gateway import PRELOAD, GatewayConfig, run_gateway
from tests.support.robots.load_robot_samples import Counters
from tests.support.waiting import wait_until

__all__ = ["LoadStack"]

CONTEXT = multiprocessing.get_context("forkserver")


class LoadStack:
    """Use as a context manager; at its end nothing of it runs."""

    may_end: tuple[str, ...] = ()  # who may end by itself, as a gateway does that finds no database

    def __init__(self, folder: Path, *, robot: Any = None, gateway: Any = None) -> None:
        """`robot` and `gateway` override fields of their configurations."""
        os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
        os.environ.setdefault("GRPC_VERBOSITY", "ERROR")
        CONTEXT.set_forkserver_preload(list(PRELOAD))
        folder.mkdir(parents=True, exist_ok=True)
        self.folder = folder
        self.gateway_config = replace(
            GatewayConfig(folder=folder, data_dir=folder / "data", http_port=free_port(), grpc_port=free_port()),
            **(gateway or {}),
        )
        self.robot_config = replace(
            RobotConfig(
                folder=folder,
                state_dir=folder / "state",
                gateway=f"{self.gateway_config.host}:{self.gateway_config.grpc_port}",
                life=-1,
            ),
            **(robot or {}),
        )
        self.processes: dict[str, Any] = {}
        self._pages: dict[int, Counters] = {}

    def __enter__(self) -> LoadStack:
        return self

    def __exit__(self, *_exc: object) -> None:
        for name in list(self.processes):
            self.kill(name)
        for page in self._pages.values():
            page.close()

    @property
    def lives(self) -> int:
        """How many lives the robot has had."""
        return self.robot_config.life + 1

    @property
    def counters(self) -> Counters:
        """Of the robot's present life."""
        return self.page(self.robot_config.life)

    def page(self, life: int) -> Counters:
        """Of one life."""
        if life not in self._pages:
            self._pages[life] = Counters(self.folder / "counters", life=life)
        return self._pages[life]

    def start(self, name: str) -> None:
        """Start "robot" or "gateway"."""
        if name == "robot":
            self.robot_config = replace(self.robot_config, life=self.robot_config.life + 1)
            self._start(name, run_robot, self.robot_config)
        else:
            self._start(name, run_gateway, self.gateway_config)

    def kill(self, name: str) -> None:
        """kill -9, and reap."""
        process = self.processes.pop(name, None)
        if process is not None:
            process.kill()
            process.join()
            process.close()

    def signal(self, name: str, number: signal.Signals) -> None:
        """Send a signal."""
        os.kill(self.processes[name].pid, number)

    def alive(self, name: str) -> bool:
        """Whether it runs."""
        return name in self.processes and self.processes[name].is_alive()

    def supervise(self) -> None:
        """Start again who may end by itself; nobody else ends by itself."""
        for name in ("gateway", "robot"):
            if not self.alive(name):
                assert name in self.may_end, f"the {name} ended by itself\n{self.tail(name)}"
                self.kill(name)
                self.start(name)

    def wait_online(self, timeout_s: float = 60.0) -> None:
        """Until the robot's link is up."""
        wait_until(lambda: self.counters["online"] == 1, timeout_s=timeout_s)

    def wait_ack(self, since_ns: int, timeout_s: float = 60.0) -> float:
        """Until something was acknowledged after that moment; how many seconds after it."""
        wait_until(lambda: self.counters["ack_ns"] > since_ns, timeout_s=timeout_s)
        return (self.counters["ack_ns"] - since_ns) / 1e9

    def end(self, timeout_s: float = 90.0) -> None:
        """The robot stops feeding and drains; then both end well."""
        wait_until(self._online, timeout_s=60)
        for name in ("robot", "gateway"):
            self.signal(name, signal.SIGTERM)
            process = self.processes[name]
            process.join(timeout_s)
            if process.exitcode != 0:
                raise AssertionError(f"the {name} ended with {process.exitcode}\n{self.tail(name)}")
            self.kill(name)

    def stored(self) -> Stored:
        """What the store has."""
        return read_sqlite(self.gateway_config.data_dir / "gateway.sqlite", self.robot_config.name)

    def check(self) -> Verdict:
        """End well, and compare."""
        self.end()
        return check(self.stored(), self.folder, lives=self.lives)

    def tail(self, name: str) -> str:
        """The end of a log."""
        path = self.folder / f"{name}.log"
        return path.read_text(errors="replace")[-3000:] if path.exists() else ""

    def status(self) -> dict[str, Any]:
        """The gateway's status file."""
        return dict(json.loads((self.folder / "gateway.json").read_text()))

    def _online(self) -> bool:
        self.supervise()
        return self.counters["online"] == 1

    def _start(self, name: str, target: Callable[[Any], None], config: Any) -> None:
        if name in self.processes:
            raise AssertionError(f"the {name} runs already")
        process = CONTEXT.Process(target=target, args=(config,), daemon=True)
        process.start()
        self.processes[name] = process
