"""A stream shows the robots in its viewer's scope, whatever its patterns say."""

from __future__ import annotations

from pathlib import Path

from gateway.domain.principal import Role
from metaros._proto import link_pb2
from tests.gateway.harness import DATA, ScriptedAgent, channel, hear, hear_bytes, open_socket, running_gateway, say
from tests.support.gateways.memory_authenticator import KeyRing
from tests.support.gateways.viewer import records

SERIES = [link_pb2.Series(series_id=1, name="battery.x", topic="/battery", field="x")]


async def test_patterns_never_reach_a_robot_out_of_scope(tmp_path: Path) -> None:
    ring = KeyRing()
    key = ring.add(role=Role.VIEWER, robots=("lab_*",))
    async with running_gateway(tmp_path, authenticator=ring) as ready:
        async with (
            ScriptedAgent(ready, "hall_1", session=b"h" * 16) as hidden,
            ScriptedAgent(ready, "lab_1", session=b"l" * 16) as shown,
        ):
            for agent in (hidden, shown):
                live = channel(1, f"/{agent.robot}/image", "std_msgs/msg/String", delivery=link_pb2.DELIVERY_CLASS_LIVE)
                stored = channel(2, f"/{agent.robot}/chatter", "std_msgs/msg/String")
                await agent.announce(live, stored, series=SERIES)
                await agent.rows(1, [(1, 5, 1.0)])
                await agent.next("ack", DATA)
            async with open_socket(ready, "/api/v1/stream", key=key) as socket:
                for number, robots in enumerate(("**", "*", "hall_1", "hall_*", "*_1")):
                    await say(socket, op="subscribe", id=number, robots=robots, topics="**")
                    await say(socket, op="subscribe_metrics", id=10 + number, robots=robots)
                await say(socket, op="subscribe_fleet", id=20)
                fleet = await hear(socket, "fleet")
                assert [robot["id"] for robot in fleet["robots"]] == ["lab_1"]
                # Both send, the hidden one first: by the time the other's are here, its would be as well.
                for agent in (hidden, shown):
                    await agent.samples(2, 1, [agent.robot.encode()], stamp_ns=7)
                    await agent.rows(2, [(1, 6, 2.0)])
                received: set[bytes] = set()
                while b"lab_1" not in received:
                    received |= {record.payload for record in records(await hear_bytes(socket))}
                assert received == {b"lab_1"}
                for number in range(5, 8):
                    await say(socket, op="subscribe_metrics", id=30 + number, robots="**")
                    assert (await hear(socket, "metrics"))["robot"] == "lab_1"
                assert (await shown.next("demand")).demand.entries[0].channel_id == 1
            assert hidden.frames[1].qsize() == 0 or all(
                frame.WhichOneof("frame") != "demand" or not frame.demand.entries for frame in drained(hidden)
            ), "what nobody may see is not asked for"


def drained(agent: ScriptedAgent) -> list[link_pb2.GatewayFrame]:
    """What waits on its control lane."""
    frames = []
    while not agent.frames[1].empty():
        frames.append(agent.frames[1].get_nowait())
    return frames
