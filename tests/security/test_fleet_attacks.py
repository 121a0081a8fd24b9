"""Attacks on what runs a fleet, as somebody who is signed in, or a robot of the fleet, would make them.

Each is about rights or bounds that lie between two parts: the history of commands, twins, downloads, and whoever reads
what robots say. What one part alone holds is tested beside it.
"""

from __future__ import annotations

import asyncio
from pathlib import Path

from gateway.domain.principal import Role
from tests.gateway.harness import RING, ScriptedAgent, client, hear, open_socket, running_gateway, say

VIEWER = RING.add(role=Role.VIEWER, name="viewer")
TWIST = {"topic": "cmd_vel", "type": "geometry_msgs/msg/Twist", "message": {}}


async def test_nobody_reads_a_drivers_lease_in_the_history(tmp_path: Path) -> None:
    """The id is all that a lease asks for: who reads it while somebody drives, drives."""
    async with running_gateway(tmp_path) as ready, client(ready) as http, ScriptedAgent(ready) as agent:
        async with open_socket(ready, "/api/v1/robots/sim_1/teleop") as driver:
            await say(driver, op="take", holder="driver")
            command = (await agent.next("command")).command
            lease_id = command.grant_lease.lease_id
            await agent.answer(command)
            await hear(driver, "granted")
            body = {"kind": "publish", "request": {**TWIST, "lease_id": lease_id}, "timeout_s": 5.0}
            sending = asyncio.create_task(http.post("/api/v1/robots/sim_1/commands", json=body))
            command = (await agent.next("command")).command
            assert command.lease_id == lease_id
            await agent.answer(command)
            done = await sending
            assert done.json()["state"] == "done"
            async with client(ready, key=VIEWER) as viewer:
                for path in ("/api/v1/commands", f"/api/v1/commands/{done.json()['id']}"):
                    page = await viewer.get(path)
                    assert page.status_code == 200
                    assert "cmd_vel" in page.text
                    assert lease_id not in page.text
