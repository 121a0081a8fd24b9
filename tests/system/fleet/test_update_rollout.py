"""Two agents are updated by the gateway itself: keys and signatures by the command line, a rollout, a bad version."""

from __future__ import annotations

import json
import shlex
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import pytest

from edge_agent.update.slots import Slots
from metaros.errors import UnavailableError
from metaros.supervise.client import ask
from metaros.supervise.program import running_pid
from tests.support.deployment.wheels import wheel_of
from tests.support.processes.command_line import call_metaros
from tests.support.processes.stack import Stack
from tests.support.servers.tuf_repository import make_bundle
from tests.support.waiting import wait_until

WITHIN_S = 300.0
SLEEPER = [sys.executable, "-S", "-c", "import time; time.sleep(3600)"]
TRIAL = ("--health-s", "0.5", "--link-s", "120", "--boots", "2")

pytestmark = [
    pytest.mark.integration,
    pytest.mark.timeout(900),
    pytest.mark.skipif(sys.platform == "win32", reason="the loader's process becomes the agent's"),
]


class CommandLine:
    """The command line of whoever runs the fleet."""

    def __init__(self, stack: Stack) -> None:
        self._stack = stack

    def __call__(self, command: str, *, gateway: bool = True) -> str:
        """What `metaros COMMAND` prints."""
        more = ["--gateway", self._stack.url] if gateway else []
        done = call_metaros(*shlex.split(command), *more, METAROS_KEY=self._stack.key)
        assert done.code == 0, f"{command}: {done.err}{done.out}"
        return done.out

    def json(self, command: str) -> Any:
        """The same as data."""
        return json.loads(self(f"{command} -o json"))


def sign_and_publish(metaros: CommandLine, folder: Path, bundles: list[Path]) -> None:
    """As docs/howto/publish_updates.md says it."""
    key = f"--passphrase-file {folder / 'words'}"
    if not (folder / "keys").exists():
        folder.mkdir()
        (folder / "words").write_text("a long and secret line\n")
        (folder / "words").chmod(0o600)
        (folder / "online.json").write_text(metaros("update online-keys"))
        metaros(f"update init-root {folder / 'keys'} --online {folder / 'online.json'} {key}", gateway=False)
    for bundle in bundles:
        metaros(f"update add {folder / 'keys'} {bundle} {key}", gateway=False)
    metaros(f"update sign {folder / 'keys'} targets {key}", gateway=False)
    metaros(f"update publish {folder / 'keys'}")


def test_a_rollout_of_the_agent(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """And a robot's node lives on over the good version, a bad one, and `kill -9`."""
    monkeypatch.setenv("HOME", str(tmp_path))
    bundles = []
    for version, broken in (("2.1.0", False), ("2.2.0", True)):
        path = tmp_path / f"metaros-{version}.zip"
        path.write_bytes(make_bundle(version, wheels=dict([wheel_of(version, broken=broken)])))
        bundles.append(path)
    config = tmp_path / "agent.toml"
    config.write_text(f"[[allowed]]\nname = 'sleeper'\ncommand = {json.dumps(SLEEPER)}\n")
    with Stack(tmp_path) as stack:
        metaros = CommandLine(stack)
        stack.router()
        stack.gateway()
        states = {name: tmp_path / "agents" / name for name in ("arm_1", "arm_2")}
        loaders = []
        for name, state in states.items():
            token = metaros.json(f"robot token --robot {name}")["token"]
            metaros(f"agent enrol {token} --name {name} --state-dir {state}")
            where = ("--zenoh-port", str(stack.zenoh_port), "--zenoh-profile", "open", "--state-dir", str(state))
            options = ("--name", name, "--namespace", f"/{name}", "--no-host-metrics", "--config", str(config), *where)
            loaders.append(stack.start(f"agent-{name}", "agent-slot", *TRIAL, *options, ready=False))
        wait_until(lambda: stack.online() == set(states), timeout_s=WITHIN_S)
        with nodes_of(states["arm_1"]) as nodes:
            (tmp_path / "twin.json").write_text(json.dumps({"nodes": {"sleeper": {"allowed": "sleeper"}}}))
            metaros(f"twin set arm_1 {tmp_path / 'twin.json'}")
            wait_until(lambda: nodes.pid() is not None, timeout_s=WITHIN_S)
            before = (nodes.pid(), running_pid(nodes.state))
            sign_and_publish(metaros, tmp_path / "updates", bundles)

            good = metaros.json("rollout start 2.1.0 --all --waves 100%")["id"]
            wait_until(lambda: state_of(stack, good) in ("done", "halted"), timeout_s=WITHIN_S, every_s=0.05)
            assert state_of(stack, good) == "done", metaros(f"rollout show {good}")
            for state in states.values():
                current = Slots(state).read()
                assert (current.version, current.state) == ("2.1.0", "good")
            assert (nodes.pid(), running_pid(nodes.state)) == before

            bad = metaros.json("rollout start 2.2.0 --all --waves 1,100%")["id"]
            wait_until(lambda: state_of(stack, bad) in ("done", "halted"), timeout_s=WITHIN_S, every_s=0.05)
            shown = metaros(f"rollout show {bad}")
            assert state_of(stack, bad) == "halted", shown
            assert "rolled_back" in shown
            found = [Slots(state).read() for state in states.values()]
            assert [current.version for current in found] == ["2.1.0", "2.1.0"]
            (failed,) = [current for current in found if current.failed_version]  # one robot tried it for all
            assert (failed.failed_version, "ended 2 times" in failed.failed_reason) == ("2.2.0", True)
            assert stack.online() == set(states)
            assert [loader.process.poll() for loader in loaders] == [None, None]  # who started them saw one process

            loaders[0].kill()
            stack.programs.remove(loaders[0])
            stack.start("agent-arm_1", *loaders[0].arguments, ready=False)
            wait_until(lambda: stack.online() == set(states), timeout_s=WITHIN_S)
            assert (nodes.pid(), running_pid(nodes.state)) == before


class Nodes:
    """What a robot's supervisor runs."""

    def __init__(self, state: Path) -> None:
        self.state = state

    def pid(self) -> int | None:
        """Of the one node; None while it does not run."""
        try:
            return next((node["pid"] for node in ask(self.state, "list")["nodes"]), None)
        except UnavailableError:
            return None


@contextmanager
def nodes_of(state: Path) -> Iterator[Nodes]:
    """They end with the block."""
    try:
        yield Nodes(state)
    finally:
        if running_pid(state) is not None:
            ask(state, "shutdown")  # so that the agent, which still lives, starts none
            wait_until(lambda: running_pid(state) is None)


def state_of(stack: Stack, rollout: str) -> str:
    """How a rollout stands."""
    return str(stack.get(f"/api/v1/rollouts/{rollout}")["state"])
