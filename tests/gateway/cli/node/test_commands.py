"""`metaros node … -r R | -l TERMS` against a running gateway with scripted robots."""

from __future__ import annotations

import asyncio
import json
from pathlib import Path

import pytest

from gateway.domain.principal import Role
from metaros._proto import link_pb2
from tests.gateway.harness import running_gateway
from tests.gateway.node_robot import node_robot
from tests.support.gateways.memory_authenticator import KeyRing
from tests.support.processes.command_line import ask_metaros

ROW = '{"allowed": "lidar"}'


async def cli(*arguments: str) -> str:
    """All that a command says; it has to end well."""
    done = await ask_metaros("node", *arguments)
    assert done.code == 0, done.err
    return done.out + done.err


async def refusal(*arguments: str) -> str:
    """What a command that fails says."""
    done = await ask_metaros("node", *arguments)
    assert done.code in (1, 2), done.out
    return done.err


def answer(command: link_pb2.Command) -> tuple[bytes, str]:
    """One log, one report of a crash, and a node that cannot be started again."""
    if command.WhichOneof("action") == "read_log":
        lines = [{"at_ns": 1_700_000_000_000_000_000, "text": "hot \x1b[31m"}]
        return json.dumps({"lines": [] if command.read_log.cursor else lines, "cursor": "9"}).encode(), ""
    if command.node_verb.verb == "crashes":
        report = {"at_ns": 1_700_000_000_000_000_000, "reason": "exit code 3", "ran_s": 1.5, "lines": ["last"]}
        return json.dumps({"crashes": [report]}).encode(), ""
    return b"", "supervisor" if command.node_verb.verb == "restart" else ""


@pytest.fixture
def admin(monkeypatch: pytest.MonkeyPatch) -> KeyRing:
    ring = KeyRing()
    monkeypatch.setenv("METAROS_KEY", ring.add(role=Role.ADMIN, name="ada"))
    return ring


async def test_nodes_of_robots(tmp_path: Path, admin: KeyRing, monkeypatch: pytest.MonkeyPatch) -> None:
    async with running_gateway(tmp_path, authenticator=admin) as ready:
        monkeypatch.setenv("METAROS_GATEWAY_URL", ready.url)
        async with node_robot(ready, "a1", answer) as one, node_robot(ready, "a2") as two:
            await cli("put", "lidar", ROW, "-r", "a1")
            assert "a2 is at revision 1" in await cli("put", "lidar", ROW, "-r", "a2")
            assert "a1 would be at revision 2" in await cli("set", "lidar", "nice=5", "-r", "a1", "--dry-run")
            assert "changed: 2 robots of 2" in await cli("set", "lidar", "nice=5", "-l", "robot in (a1, a2)")
            said = await refusal("set", "lidar", "nice=50", "-l", "robot in (a1, a2)")
            assert "nodes.lidar.nice: -20 to 19, not 50" in said

            stopped = await cli("stop", "lidar", "-l", "robot in (a1, a2)", "--reason", "lens")
            assert stopped.splitlines()[0] == "a1  stop lidar: done (revision 3)"
            assert one.verbs == two.verbs == [("lidar", "stop", 0)]
            assert "a1  start lidar: would be done (revision 4)" in await cli("start", "lidar", "-r", "a1", "--dry-run")
            assert "1 robot did not do it" in await refusal("restart", "lidar", "-l", "robot in (a1, a2)")
            assert two.verbs[-1] == ("lidar", "restart", 0)
            await cli("signal", "lidar", "10", "-r", "a1")
            assert one.verbs[-1] == ("lidar", "signal", 10)

            shown = json.loads(await cli("list", "-r", "a1", "-o", "json"))
            assert [(item["name"], item["wanted"]) for item in shown] == [("lidar", "stopped")]
            rows = (await cli("list", "-l", "robot in (a1, a2)")).splitlines()
            assert [row.split()[:3] for row in rows] == [["a1", "lidar", "stopped"], ["a2", "lidar", "stopped"]]
            info = await cli("info", "lidar", "-r", "a1")
            assert info.startswith("a1 lidar  /a1/lidar\n  wanted     stopped\n")

            log = await cli("log", "lidar", "-r", "a1")
            assert log == "2023-11-14T22:13:20.000  hot \\x1b[31m\n"
            crashes = await cli("crashes", "lidar", "-r", "a1")
            assert "2023-11-14T22:13:20Z  exit code 3 after 1.5 s\n    last\n" in crashes
            assert "say --robot R, or -l TERMS" in await refusal("start", "lidar")
            assert "- /nodes/lidar: {" in await cli("remove", "lidar", "-r", "a1")


async def test_a_log_is_followed_until_the_robot_is_gone(
    tmp_path: Path, admin: KeyRing, monkeypatch: pytest.MonkeyPatch
) -> None:
    async with running_gateway(tmp_path, authenticator=admin) as ready:
        monkeypatch.setenv("METAROS_GATEWAY_URL", ready.url)
        asked = asyncio.Event()

        def reported(command: link_pb2.Command) -> tuple[bytes, str]:
            if command.read_log.cursor:  # the second look: the first lines are out
                asked.set()
            return answer(command)

        async with node_robot(ready, "a1", reported) as one:
            await cli("put", "lidar", ROW, "-r", "a1")
            following = asyncio.create_task(ask_metaros("node", "log", "lidar", "-r", "a1", "-f", "-o", "json"))
            async with asyncio.timeout(60):
                await asked.wait()
            for lane in one.agent.lanes.values():
                lane.cancel()
            done = await following
            assert (done.code, "robot a1" in done.err) == (1, True), done.err
            assert "hot" in done.out.splitlines()[0]
