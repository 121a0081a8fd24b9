"""The unmodified client of Lichtblick, under node, passes the whole scenario against a real gateway."""

from __future__ import annotations

import asyncio
import json
import shutil
from pathlib import Path
from typing import Any

import pytest

from metaros.idl import schema_text
from tests.gateway.api.foxglove.robot import STRING, Answering, text
from tests.gateway.harness import OPERATOR_KEY, channel, running_gateway

HERE = Path(__file__).parent
MODULES = HERE.parents[1] / "dashboard" / "node_modules"
STAMP_NS = 1_700_000_000_123_456_789

pytestmark = [
    pytest.mark.integration,
    pytest.mark.skipif(
        shutil.which("node") is None or not (MODULES / "@foxglove" / "ws-protocol").is_dir(),
        reason="node or the dashboard's packages are not there",
    ),
]


class Script:
    """The scenario as a process; a step is a line of JSON."""

    def __init__(self, process: asyncio.subprocess.Process) -> None:
        self.process = process

    async def step(self, name: str) -> Any:
        """What the next step says, which has to be that one."""
        assert self.process.stdout is not None
        line = await asyncio.wait_for(self.process.stdout.readline(), 60)
        said = json.loads(line or b'{"end": null}')
        assert list(said) == [name], said
        return said[name]


async def changing(robot: Answering) -> None:
    """The robot's parameter never stays the same."""
    while True:
        robot.speed += 1.0
        await asyncio.sleep(0.5)


async def test_lichtblicks_client_passes(tmp_path: Path) -> None:
    folder = tmp_path / "assets"
    (folder / "arm").mkdir(parents=True)
    (folder / "arm" / "link.stl").write_bytes(b"solid")
    async with running_gateway(tmp_path, assets_dir=folder) as ready, Answering.of(ready) as robot:
        await robot.agent.announce(channel(1, "/sim_1/chatter", STRING))
        process = await asyncio.create_subprocess_exec(
            "node",
            str(HERE / "foxglove_scenario.mjs"),
            str(MODULES),
            f"ws://127.0.0.1:{ready.foxglove_port}/sim_1?token={OPERATOR_KEY}",
            stdout=asyncio.subprocess.PIPE,
        )
        try:
            await scenario(Script(process), robot)
            assert await asyncio.wait_for(process.wait(), 60) == 0
        finally:
            if process.returncode is None:
                process.kill()
                await process.wait()


async def scenario(script: Script, robot: Answering) -> None:
    """Step by step."""
    info = await script.step("info")
    assert (info["name"], info["protocol"]) == ("Meta-ROS sim_1", "foxglove.sdk.v1")
    assert {"clientPublish", "services", "parameters", "connectionGraph", "time", "assets"} <= set(info["capabilities"])
    offered = await script.step("channel")
    assert (offered["encoding"], offered["schemaName"], offered["schema"]) == ("cdr", STRING, schema_text(STRING))
    subscription = await script.step("subscribed")
    await robot.agent.samples(1, 1, [text("hello")], stamp_ns=STAMP_NS)
    sample = await script.step("message")
    assert sample == {"subscription": subscription, "time": str(STAMP_NS), "data": text("hello").hex()}
    assert int(await script.step("time")) > 10**18
    service = await script.step("service")
    assert (service["type"], service["call"], service["encoding"]) == ("std_srvs/srv/Trigger", 12, "json")
    assert json.loads(service["data"]) == {"success": True, "message": "on"}
    assert (await script.step("failure"))["callId"] == 13
    assert robot.published == [("/sim_1/orders", STRING, text("from node"))]
    speed = {"name": "/sim_1/base.speed", "value": 1.5, "type": "float64"}
    assert await script.step("parameters") == [speed]
    assert await script.step("set") == [{**speed, "value": 3.5}]
    await script.step("watching")
    change = asyncio.create_task(changing(robot))
    assert await script.step("news") == speed["name"]
    change.cancel()
    graph = await script.step("graph")
    assert graph["published"] == [{"name": "/sim_1/chatter", "publisherIds": ["/sim_1/base"]}]
    assert graph["removed"] == []
    assert await script.step("asset") == {"request": 7, "status": 0, "data": "solid"}
    assert await script.step("no_asset") == 1
