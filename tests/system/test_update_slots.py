"""A robot updates itself, in real processes: wheels of this project, a trial, a bad version, a node that lives on.

Only the gateway is small: it speaks the link, and its files are those of a repository made here.
"""

from __future__ import annotations

import hashlib
import json
import os
import re
import shutil
import subprocess
import sys
from collections.abc import Iterator
from contextlib import ExitStack
from pathlib import Path
from typing import Any

import pytest

from edge_agent.identity.files import IdentityFiles, RobotIdentity
from edge_agent.identity.key import key_to_pem, new_key
from edge_agent.update.slots import Slots
from metaros._proto import link_pb2
from metaros.bundle import Manifest
from metaros.clock import SystemClock
from metaros.supervise.program import running_pid
from tests.support.fake_gateway import CONTROL, fake_gateway
from tests.support.fleet_ca import FleetCa
from tests.support.gateway_half import GatewayHalf
from tests.support.processes import END_S, started
from tests.support.tuf_repository import TufRepository, make_bundle, serve, utc
from tests.support.waiting import wait_until, wait_until_async

ROOT = Path(__file__).resolve().parents[2]
TOKEN = "mrf_story"
WITHIN_S = 240.0
SLEEPER = {"command": [sys.executable, "-c", "import threading; threading.Event().wait(900)"]}

pytestmark = [
    pytest.mark.integration,
    pytest.mark.timeout(900),
    pytest.mark.skipif(sys.platform != "linux", reason="reads /proc, and ends the supervisor by its number"),
]


class TwinHalf(GatewayHalf):
    """A gateway that wants something of its robot, and confirms whatever it lives by."""

    def __init__(self) -> None:
        super().__init__()
        self.welcome.fetch_token, self.welcome.twin = TOKEN, True
        self.desired = link_pb2.TwinDesired()
        self.reported: dict[str, Any] = {}

    def want(self, document: dict[str, Any]) -> link_pb2.GatewayFrame:
        """The next revision."""
        text = json.dumps(document, sort_keys=True, separators=(",", ":")).encode()
        self.desired = link_pb2.TwinDesired(
            revision=self.desired.revision + 1,
            sha256=hashlib.sha256(text).digest(),
            document=text,
            confirm_within_ms=60_000,
        )
        return link_pb2.GatewayFrame(twin=self.desired)

    def on_twin(self, _lane: int, report: link_pb2.TwinReport) -> None:
        """What the robot is."""
        self.reported = json.loads(report.reported or b"{}")
        if report.revision < self.desired.revision:
            self.out[CONTROL].append(link_pb2.GatewayFrame(twin=self.desired))
        if report.state == "confirming":
            confirmed = link_pb2.TwinConfirmed(revision=report.revision)
            self.out[CONTROL].append(link_pb2.GatewayFrame(twin_confirmed=confirmed))

    def update(self) -> dict[str, Any]:
        """How the update of the agent goes."""
        agent = self.reported.get("agent", {})
        return {"runs": agent.get("version"), **agent.get("update", {})}

    def pid(self) -> int:
        """Of the node."""
        return int(self.reported.get("nodes", {}).get("sleeper", {}).get("pid") or 0)


def build_wheel(folder: Path, version: str, *, broken: bool = False) -> tuple[str, bytes]:
    """A wheel of this project as that version, without the dashboard; a broken one's agent ends at its start."""
    tree = folder / version
    for package in ("metaros", "edge_agent", "gateway"):
        shutil.copytree(ROOT / package, tree / package, ignore=shutil.ignore_patterns("__pycache__", "static"))
    for name in ("README.md", "LICENSE"):
        shutil.copy(ROOT / name, tree)
    project = (ROOT / "pyproject.toml").read_text()
    project = re.sub(r'^version = ".*"$', f'version = "{version}"', project, count=1, flags=re.MULTILINE)
    project = re.sub(r"\[tool\.hatch\.build\.hooks\.custom\]\npath = .*\n", "", project)
    (tree / "pyproject.toml").write_text(project)
    if broken:
        main = tree / "edge_agent" / "main.py"
        main.write_text(main.read_text() + "\nraise SystemExit('this version does not start')\n")
    build = [sys.executable, "-m", "hatchling", "build", "-t", "wheel", "-d", str(folder / "out" / version)]
    done = subprocess.run(build, cwd=tree, capture_output=True, text=True, timeout=END_S * 2, check=False)
    assert done.returncode == 0, done.stderr
    (wheel,) = (folder / "out" / version).glob("*.whl")
    return wheel.name, wheel.read_bytes()


def published(folder: Path) -> TufRepository:
    """2.1.0 is good, 2.2.0 is broken."""
    repository = TufRepository(utc(SystemClock().wall_ns()))
    for version, broken in (("2.1.0", False), ("2.2.0", True)):
        bundle = make_bundle(version, wheels=dict([build_wheel(folder, version, broken=broken)]))
        custom = Manifest(name="metaros", kind="agent", version=version).custom
        repository.add(f"agents/metaros/{version}.zip", bundle, custom)
    repository.publish()
    return repository


def enrol(state: Path, url: str) -> None:
    """As if that gateway had."""
    ca, key = FleetCa(), new_key()
    identity = RobotIdentity(
        robot="r1",
        fleet=ca.fleet,
        url=url,
        system_trust=False,
        grpc_port=0,
        grpc_tls=False,
        certificate=ca.robot(key.public_key(), "r1"),
        chain=ca.chain,
        roots=ca.roots,
        key=key_to_pem(key),
    )
    IdentityFiles(state).save(identity)


@pytest.fixture
def state(tmp_path: Path) -> Iterator[Path]:
    """A state directory whose supervisor does not outlive the test."""
    path = tmp_path / "state"
    yield path
    pid = running_pid(path)
    if pid is not None:
        stop = [sys.executable, "-m", "metaros", "supervisor", "stop", "--state-dir", str(path)]
        subprocess.run(stop, capture_output=True, timeout=END_S, check=False)
        wait_until(lambda: running_pid(path) is None)


async def test_a_good_version_is_kept_a_bad_one_taken_back_and_the_node_lives_on(
    tmp_path: Path, state: Path, zenoh_router: str
) -> None:
    half, config = TwinHalf(), tmp_path / "agent.toml"
    config.write_text("[nodes]\nfree_commands = true\n[black_box]\nenabled = false\n[outbox]\nreserve_bytes = 65536\n")
    with ExitStack() as stack:
        served = stack.enter_context(serve(published(tmp_path / "build")))
        served.token = TOKEN
        enrol(state, served.url)
        async with fake_gateway(half) as gateway:
            options = ["--name", "r1", "--namespace", "/r1", "--gateway", gateway.target, "--no-host-metrics"]
            options += ["--zenoh-port", zenoh_router.rpartition(":")[2], "--zenoh-profile", "open"]
            options += ["--state-dir", str(state), "--config", str(config)]
            trial = ["--health-s", "1.5", "--link-s", "120", "--boots", "2"]
            half.want({"nodes": {"sleeper": SLEEPER}})
            argv = [sys.executable, "-m", "metaros", "agent-slot", *trial, *options]
            process = stack.enter_context(started(argv, stderr=None, stdout=None))

            await wait_until_async(lambda: half.pid() > 0, timeout_s=WITHIN_S)
            pid, supervisor = half.pid(), running_pid(state)
            assert half.update()["state"] == "idle"

            gateway.say(half.want({"nodes": {"sleeper": SLEEPER}, "agent": {"version": "2.1.0"}}))
            await wait_until_async(lambda: half.update().get("state") == "healthy", timeout_s=WITHIN_S)
            assert half.update() == {"runs": "2.1.0", "state": "healthy", "version": "2.1.0", "code": "", "message": ""}
            assert half.hellos[-1].agent_version == "2.1.0"

            gateway.say(half.want({"nodes": {"sleeper": SLEEPER}, "agent": {"version": "2.2.0"}}))
            await wait_until_async(lambda: half.update().get("state") == "rolled_back", timeout_s=WITHIN_S)
            found = half.update()
            assert (found["runs"], found["version"], found["code"]) == ("2.1.0", "2.2.0", "update_unhealthy")
            assert "ended 2 times" in found["message"]
            assert {hello.agent_version for hello in half.hellos} & {"2.2.0"} == set()

            current = Slots(state).read()
            assert (current.version, current.state) == ("2.1.0", "good")
            await wait_until_async(lambda: half.pid() == pid, timeout_s=WITHIN_S)
            os.kill(pid, 0)  # it is there
            assert running_pid(state) == supervisor
            assert process.poll() is None  # who started the loader has seen one process all the time
