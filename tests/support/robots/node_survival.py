"""A robot's nodes keep their processes over everything that may end beside them; run by `test_node_survival.py`.

`python -m tests.support.robots.node_survival FOLDER` inside namespaces of its own (`INSIDE`): their network is
ours, so that the link can be cut by the kernel, and no process of theirs outlives them.
"""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
import time
from pathlib import Path
from typing import Any

import psutil

from metaros.errors import UnavailableError
from metaros.supervise.client import ask
from metaros.supervise.program import running_pid
from tests.support.processes.netns import INSIDE as NETWORK
from tests.support.processes.netns import run
from tests.support.processes.processes import alive
from tests.support.processes.stack import Stack
from tests.support.waiting import wait_until
from tests.system.fleet.test_update_rollout import CommandLine

__all__ = ["INSIDE"]

INSIDE = (*NETWORK, "--pid", "--mount-proc")
ROBOT, WITHIN_S = "arm_1", 300.0
HEARTBEAT_S = 0.5  # the gateway calls a robot offline that is silent for three of them
PARENT = """
import subprocess, sys, time
child = subprocess.Popen([sys.executable, "-S", "-c", "import time; time.sleep(3600)"])
print("child", child.pid, flush=True)
time.sleep(3600)
"""
NODES = {"plain": "import time; time.sleep(3600)", "parent": PARENT}


class Story:
    """One robot and its gateway."""

    def __init__(self, stack: Stack) -> None:
        self.stack = stack
        self.metaros = CommandLine(stack)
        self.state = stack.folder / "robot"
        self.began_s = time.monotonic()

    def begin(self) -> None:
        """All programs, and nodes by the twin."""
        stack = self.stack
        stack.router()
        self.gateway = stack.gateway("--heartbeat-s", f"{HEARTBEAT_S:g}")
        config = stack.folder / "agent.toml"
        rows = [f"[[allowed]]\nname = '{name}'\ncommand = {json.dumps(self.argv(name))}\n" for name in NODES]
        config.write_text('transport = "grpc"\n[black_box]\nenabled = false\n' + "".join(rows))
        self.agent = stack.agent(ROBOT, "--state-dir", str(self.state), "--config", str(config))
        wait_until(self.online, timeout_s=WITHIN_S)
        document = {"nodes": {name: {"allowed": name} for name in NODES}}
        path = stack.folder / "twin.json"
        path.write_text(json.dumps(document))
        self.metaros(f"twin set {ROBOT} {path}")
        wait_until(lambda: len(self.pids()) == len(NODES) + 1, timeout_s=WITHIN_S)
        wait_until(lambda: self.metaros.json(f"twin show {ROBOT}")["in_step"], timeout_s=WITHIN_S)  # no trial any more
        self.before, self.supervisor = self.pids(), running_pid(self.state)
        self.say(f"supervisor {self.supervisor}, nodes {self.before}")

    @staticmethod
    def argv(name: str) -> list[str]:
        """What the robot's own list says."""
        return [sys.executable, "-S", "-c", NODES[name]]

    def pids(self) -> dict[str, int]:
        """Of the nodes, and of what one of them has started."""
        try:
            found = {node["name"]: node["pid"] for node in self.nodes() if node["state"] == "running"}
        except UnavailableError:
            return {}
        for child in psutil.Process(found["parent"]).children() if "parent" in found else []:
            found["its child"] = child.pid
        return found

    def nodes(self) -> list[dict[str, Any]]:
        """As the supervisor has them."""
        return list(ask(self.state, "list")["nodes"])

    def online(self) -> bool:
        """Whether the gateway calls the robot so."""
        return ROBOT in self.stack.online()

    def same(self, what: str) -> None:
        """Nobody's process is another one."""
        assert self.pids() == self.before, f"{what}: {self.pids()} were {self.before}"
        assert running_pid(self.state) == self.supervisor, what
        assert all(node["restarts"] == 0 for node in self.nodes())
        self.say(f"{what}: the same processes")

    def say(self, text: str) -> None:
        """What happens, for whoever reads a failure."""
        print(f"{time.monotonic() - self.began_s:7.1f} s  {text}", flush=True)

    # -- what may end ----------------------------------------------------------------------------------------------

    def cut(self) -> None:
        """No packet of the link gets through, and nobody is told, until the gateway has given the robot up."""
        run("nft add table inet fault")
        for hook in ("input", "output"):
            run(f"nft add chain inet fault {hook} {{ type filter hook {hook} priority 0 ; }}")
            for end in ("sport", "dport"):
                run(f"nft add rule inet fault {hook} tcp {end} {self.stack.grpc_port} drop")
        wait_until(lambda: not self.online(), timeout_s=WITHIN_S)
        self.say("the gateway no longer calls the robot online")
        healed_s = time.monotonic() + 6 * HEARTBEAT_S  # and the agent the link dead
        wait_until(lambda: time.monotonic() > healed_s)
        assert self.pids() == self.before, f"during the cut: {self.nodes()}"
        run("nft delete table inet fault")
        wait_until(self.online, timeout_s=WITHIN_S)
        self.same("the link was cut")

    def restart_gateway(self) -> None:
        """Killed, and another one on the same data."""
        self.gateway.kill()
        self.gateway = self.stack.restart(self.gateway)
        wait_until(self.online, timeout_s=WITHIN_S)
        self.same("another gateway")

    def kill_agent(self) -> None:
        """kill -9, and started again as a system does."""
        session = self.session()
        self.agent.kill()
        self.same("kill -9 of the agent")
        self.agent = self.stack.restart(self.agent)
        wait_until(lambda: self.online() and self.session() > session, timeout_s=WITHIN_S)
        self.same("another agent")

    def session(self) -> int:
        """The number of its link's session: each agent begins another one."""
        found = self.stack.get(f"/api/v1/robots/{ROBOT}")
        return int(found["link"]["session"]) if found and found["link"] else 0

    def kill_supervisor(self) -> None:
        """The end of all of them; the agent starts another one, and that one the nodes."""
        assert self.supervisor is not None
        os.kill(self.supervisor, signal.SIGKILL)
        began_s = time.monotonic()
        wait_until(lambda: not any(alive(pid) for pid in self.before.values()))
        self.say(f"the supervisor was killed: all were gone within {time.monotonic() - began_s:.2f} s")
        wait_until(lambda: len(self.pids()) == len(NODES) + 1, timeout_s=WITHIN_S)
        assert not set(self.pids().values()) & set(self.before.values())
        assert running_pid(self.state) != self.supervisor
        self.say("and the agent has brought them back")


def main(folder: Path) -> None:
    """The whole story."""
    subprocess.run(["ip", "link", "set", "lo", "up"], check=True)
    os.environ["HOME"] = str(folder)
    with Stack(folder) as stack:
        story = Story(stack)
        story.begin()
        story.kill_agent()
        story.cut()
        story.restart_gateway()
        story.kill_supervisor()


if __name__ == "__main__":
    main(Path(sys.argv[1]))
