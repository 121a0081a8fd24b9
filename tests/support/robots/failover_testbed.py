"""Two robots, a gateway and a migratable node as real processes in networks of their own; run it inside `unshare`.

    unshare -Urnm --fork --kill-child python -m tests.support.robots.failover_testbed FOLDER [LIBFAKETIME]

Robot `far` is at the other end of a cable, `near` is on the gateway's side. The node writes a line when it starts and
every 20 ms after, all lives of all robots into one file, by the one clock that both networks share. So whoever runs
when, and for how long nobody does, is read from that file alone. The last line printed is what was found, as JSON.
"""

from __future__ import annotations

import contextlib
import json
import os
import select
import signal
import socket
import subprocess
import sys
import threading
import time
import urllib.error
import urllib.request
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from itertools import pairwise
from pathlib import Path
from typing import Any

from gateway.identity.local_key import LOCAL_KEY_FILE
from metaros.supervise.program import running_pid
from tests.support.ports import free_port
from tests.support.processes.netns import HERE, Wire
from tests.support.waiting import wait_until

__all__ = ["Life", "lives_in", "main", "overlaps"]

BEAT = """
import os, sys, time
out = os.open(sys.argv[1], os.O_WRONLY | os.O_APPEND)
head = f"{sys.argv[2]} {os.getpid()} {os.environ['METAROS_LEASE_EPOCH']} "
while True:
    os.write(out, (head + f"{time.clock_gettime_ns(time.CLOCK_BOOTTIME)}\\n").encode())
    time.sleep(0.02)
"""
NODE = "map"
ROBOTS = ("far", "near")


@dataclass
class Life:
    """One process of the node: who, under which epoch, and when it was seen first and last."""

    robot: str
    epoch: int
    first_ns: int
    last_ns: int


def lives_in(text: str) -> list[Life]:
    """In the order in which they began."""
    found: dict[tuple[str, str], Life] = {}
    for line in text.splitlines():
        robot, pid, epoch, at_ns = line.split()
        life = found.setdefault((robot, pid), Life(robot, int(epoch), int(at_ns), int(at_ns)))
        life.first_ns, life.last_ns = min(life.first_ns, int(at_ns)), max(life.last_ns, int(at_ns))
    return sorted(found.values(), key=lambda life: life.first_ns)


def overlaps(lives: list[Life]) -> list[str]:
    """Lives that began before the one before had ended, and epochs that did not grow with a move."""
    found = []
    for before, after in pairwise(lives):
        if after.first_ns <= before.last_ns:
            found.append(
                f"{after.robot} began {(before.last_ns - after.first_ns) / 1e9:.3f} s before {before.robot} ended"
            )
        if after.epoch < before.epoch or (after.epoch == before.epoch and after.robot != before.robot):
            found.append(f"{after.robot} has epoch {after.epoch} after {before.robot} had {before.epoch}")
    return found


@dataclass
class Relay:
    """Carries the gateway's robots' port to the cable. What is not read yet waits in the kernel's buffers."""

    target_port: int
    listener: socket.socket = field(default_factory=lambda: socket.create_server((HERE, 0)))

    def __post_init__(self) -> None:
        threading.Thread(target=self._accept, daemon=True).start()

    def _accept(self) -> None:
        while True:
            near, _ = self.listener.accept()
            try:
                far = socket.create_connection(("127.0.0.1", self.target_port), timeout=5)
            except OSError:
                near.close()
                continue
            threading.Thread(target=self._carry, args=(near, far), daemon=True).start()

    @staticmethod
    def _carry(one: socket.socket, other: socket.socket) -> None:
        with one, other, contextlib.suppress(OSError):
            while True:
                for ready in select.select([one, other], [], [])[0]:
                    if not (data := ready.recv(65536)):
                        return
                    (other if ready is one else one).sendall(data)


class Testbed:
    """All of it; use `running_testbed`."""

    def __init__(self, folder: Path, wire: Wire, faketime: str) -> None:
        self.folder, self.wire, self.faketime = folder, wire, faketime
        self.http_port, self.grpc_port = free_port(), free_port()
        self.relay_port = int(Relay(self.grpc_port).listener.getsockname()[1])
        self.processes: dict[str, subprocess.Popen[bytes]] = {}
        self.lines = folder / "lines"
        self.lines.touch()
        self.step_file = folder / "step"
        self.step_file.write_text("+0\n")
        for robot in ROBOTS:
            command = [sys.executable, "-S", "-c", BEAT, str(self.lines), robot]
            (folder / f"{robot}.toml").write_text(f'[[allowed]]\nname = "beat"\ncommand = {json.dumps(command)}\n')

    def start(self, name: str, *arguments: str, prefix: tuple[str, ...] = (), **environment: str) -> None:
        """`metaros ARGUMENTS`."""
        with (self.folder / f"{name}.log").open("ab") as out:
            self.processes[name] = subprocess.Popen(
                [*prefix, sys.executable, "-m", "metaros", *arguments],
                stdout=out,
                stderr=subprocess.STDOUT,
                stdin=subprocess.DEVNULL,
                env={**os.environ, **environment},
            )

    def gateway(self) -> None:
        """Its calendar is that of `step_file`, where this machine has libfaketime."""
        fake = {"LD_PRELOAD": self.faketime, "FAKETIME_TIMESTAMP_FILE": str(self.step_file)} if self.faketime else {}
        if fake:
            fake |= {"FAKETIME_CACHE_DURATION": "1", "DONT_FAKE_MONOTONIC": "1"}
            fake |= {"FAKETIME_FORCE_MONOTONIC_FIX": "0"}  # else threads that wait with a time-out spin
        ports = ("--port", str(self.http_port), "--grpc-port", str(self.grpc_port), "--api-grpc-port", str(free_port()))
        self.start("gateway", "gateway", "--host", "127.0.0.1", *ports, "--data-dir", str(self.folder / "data"), **fake)

    def agent(self, robot: str) -> None:
        """One with a router, a state directory and an allow-list of its own."""
        far = robot == "far"
        where = f"{HERE}:{self.relay_port}" if far else f"127.0.0.1:{self.grpc_port}"
        options = ("--gateway", where, "--zenoh-port", str(free_port()), "--state-dir", str(self.folder / robot))
        options += ("--config", str(self.folder / f"{robot}.toml"), "--no-host-metrics")
        prefix = ("nsenter", "-t", str(self.wire.pid), "-n") if far else ()
        self.start(robot, "agent", "--name", robot, "--namespace", f"/{robot}", *options, prefix=prefix)

    def ask(self, method: str, path: str, body: object = None) -> Any:
        """The REST API, as an administrator; None while there is nobody."""
        try:
            key = (self.folder / "data" / LOCAL_KEY_FILE).read_text().strip()
            request = urllib.request.Request(
                f"http://127.0.0.1:{self.http_port}/api/v1{path}",
                method=method,
                data=None if body is None else json.dumps(body).encode(),
                headers={"Authorization": f"Bearer {key}", "Content-Type": "application/json"},
            )
            with urllib.request.urlopen(request, timeout=30) as answer:
                return json.load(answer)
        except urllib.error.HTTPError as error:
            if error.code not in (401, 404, 503):  # 401: the key of the gateway that was killed
                raise AssertionError(f"{method} {path}: {error.code} {error.read()[:500]!r}") from error
        except (OSError, ValueError):  # nobody is there yet, or not any more
            pass
        return None

    def waits(self, robot: str) -> bool:
        """Whether the robot has told that it could run the node."""
        found = self.ask("GET", f"/robots/{robot}/nodes/{NODE}") or {}
        reported = found.get("reported") or {}
        return bool(found.get("online")) and (reported.get("state"), reported.get("why")) == ("stopped", "no lease")

    def lives(self) -> list[Life]:
        """Whole lines only."""
        text = self.lines.read_text()
        return lives_in(text[: text.rfind("\n") + 1])

    def begins(self, robot: str, *, since_ns: int, timeout_s: float = 90.0) -> Life:
        """The node's first life on that robot that began since."""

        def found() -> list[Life]:
            return [life for life in self.lives() if life.robot == robot and life.first_ns > since_ns]

        wait_until(found, timeout_s=timeout_s, every_s=0.1)  # when it began says the file
        return found()[0]

    def lose(self, robot: str) -> None:
        """kill -9 of all that the robot runs, as a power cut does it."""
        self.processes[robot].kill()
        supervisor = running_pid(self.folder / robot)
        if supervisor:
            os.kill(supervisor, signal.SIGKILL)
        self.processes[robot].wait(60)
        wait_until(lambda: running_pid(self.folder / robot) is None)

    def stays(self, robot: str, *, until: Callable[[], object]) -> None:
        """Until then it begins nowhere else."""
        since_ns = now_ns()
        wait_until(until, timeout_s=120, every_s=0.2)
        moved = [life for life in self.lives() if life.first_ns > since_ns and life.robot != robot]
        assert not moved, f"it moved from {robot}: {moved}"


def now_ns() -> int:
    """The clock of the lines."""
    return time.clock_gettime_ns(time.CLOCK_BOOTTIME)


@contextlib.contextmanager
def running_testbed(folder: Path, faketime: str) -> Iterator[Testbed]:
    """Everything is up, and the node runs on `far`."""
    with Wire() as wire:
        world = Testbed(folder, wire, faketime)
        try:
            world.gateway()
            world.agent("far")
            document = {"nodes": {NODE: {"allowed": "beat", "restart": "always", "migratable": True}}}
            template = {"selector": "", "document": document}
            wait_until(lambda: world.ask("PUT", "/templates/all", template), timeout_s=120, every_s=0.2)
            world.begins("far", since_ns=0, timeout_s=120)
            world.agent("near")
            wait_until(lambda: world.waits("near"), timeout_s=120, every_s=0.2)
            yield world
        finally:
            for process in world.processes.values():
                with contextlib.suppress(ProcessLookupError):
                    process.send_signal(signal.SIGCONT)
                process.kill()
                process.wait(60)
            for robot in ROBOTS:
                if supervisor := running_pid(folder / robot):
                    os.kill(supervisor, signal.SIGKILL)


# -- what goes wrong ---------------------------------------------------------------------------------------------------


def move(world: Testbed, to: str, fault: Callable[[], None]) -> float:
    """Seconds from a fault to the node's first sign of life on the other robot."""
    at_ns = now_ns()
    fault()
    return (world.begins(to, since_ns=at_ns).first_ns - at_ns) / 1e9


def story(world: Testbed) -> dict[str, float]:
    """One fault after the other; the seconds that each took."""
    took = {}

    def step_clock() -> None:
        world.wire.drop()
        world.step_file.write_text("+3600s\n")

    took["partition, the gateway's clock an hour ahead"] = move(world, "near", step_clock)
    world.step_file.write_text("-3600s\n")
    world.wire.heal()  # what lay in the buffers arrives, and the node stays where it is
    world.stays("near", until=lambda: world.waits("far"))

    took["host killed"] = move(world, "far", lambda: world.lose("near"))
    world.agent("near")
    wait_until(lambda: world.waits("near"), timeout_s=120, every_s=0.2)

    agent = world.processes["far"]
    took["agent stands still"] = move(world, "near", lambda: stop(world, "far"))
    agent.send_signal(signal.SIGCONT)  # it reads frames of ten seconds ago now, and tells that it has
    world.stays("near", until=lambda: world.waits("far"))

    def both() -> None:
        world.processes["gateway"].kill()
        world.lose("near")
        world.processes["gateway"].wait(60)
        world.gateway()

    at_ns = now_ns()
    both()
    wait_until(lambda: world.ask("GET", "/robots"), timeout_s=120, every_s=0.05)
    ready_ns = now_ns()
    first_ns = world.begins("far", since_ns=at_ns, timeout_s=120).first_ns
    took["host and gateway killed, from when the gateway is back"] = (first_ns - ready_ns) / 1e9
    return took


def stop(world: Testbed, robot: str) -> None:
    """SIGSTOP of the agent; nsenter has become it."""
    world.processes[robot].send_signal(signal.SIGSTOP)


def main() -> int:
    """Run the story, and judge it by what the node wrote."""
    folder, faketime = Path(sys.argv[1]), sys.argv[2] if len(sys.argv) > 2 else ""
    with running_testbed(folder, faketime) as world:
        try:
            took = story(world)
        except AssertionError:
            for log in sorted(folder.glob("*.log")):
                print(f"--- {log.name}\n{log.read_text(errors='replace')[-3000:]}")
            print("\n".join(map(str, world.lives())))
            raise
        lives = world.lives()
    gaps = [(after.first_ns - before.last_ns) / 1e9 for before, after in pairwise(lives)]
    print(json.dumps({"took": took, "lives": len(lives), "gaps": gaps, "problems": overlaps(lives)}))
    return int(bool(overlaps(lives)))


if __name__ == "__main__":
    sys.exit(main())
