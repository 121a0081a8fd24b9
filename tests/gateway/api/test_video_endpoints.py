"""Video by every endpoint that passes payloads on: each viewer begins at a key frame, which the robot is asked for."""

from __future__ import annotations

import asyncio
from pathlib import Path

import grpc

from gateway.domain.principal import Role
from gateway.domain.records import split_records
from metaros._proto import link_pb2, telemetry_pb2, telemetry_pb2_grpc
from tests.gateway.api.foxglove.viewer import Viewer, viewing
from tests.gateway.harness import RING, ScriptedAgent, channel, hear_bytes, open_socket, running_gateway, say
from tests.support.devices.video import COMPRESSED_VIDEO, access_units, video_message
from tests.support.gateways.memory_authenticator import bearer

TOPIC = "/sim_1/video"
KEY = RING.add(role=Role.OPERATOR)
MESSAGES = [video_message(unit) for unit in access_units(12, group=6)]


async def asked(agent: ScriptedAgent, *, viewers: int, key_frames: int) -> link_pb2.DemandEntry:
    """What the robot was told when so many look, and after so many wishes."""
    while True:
        demand = (await agent.next("demand")).demand
        found = [entry for entry in demand.entries if entry.viewers == viewers and entry.key_frames >= key_frames]
        if found:
            return found[0]


async def by_foxglove(viewer: Viewer, count: int) -> list[bytes]:
    """So many payloads of MessageData."""
    return [(await viewer.binary(1))[12:] for _ in range(count)]


async def by_grpc(call: grpc.aio.UnaryStreamCall, count: int) -> list[bytes]:  # type: ignore[type-arg]
    """So many payloads of replies."""
    found: list[bytes] = []
    while len(found) < count:
        reply = await call.read()
        found += [sample.cdr for sample in reply.samples]
    return found


async def test_each_endpoint_begins_at_a_key_frame(tmp_path: Path) -> None:
    async with running_gateway(tmp_path) as ready, ScriptedAgent(ready) as agent:
        await agent.announce(channel(1, TOPIC, COMPRESSED_VIDEO, delivery=link_pb2.DELIVERY_CLASS_LIVE))
        async with (
            open_socket(ready, "/api/v1/stream") as socket,
            viewing(ready, "/sim_1") as foxglove,
            grpc.aio.insecure_channel(f"127.0.0.1:{ready.api_grpc_port}") as opened,
        ):
            await say(socket, op="subscribe", id=1, robots="*", topics=TOPIC)
            first = await asked(agent, viewers=1, key_frames=1)
            assert (first.channel_id, first.max_rate_hz) == (1, 0.0)
            await agent.samples(1, 1, MESSAGES[:2])
            frames = [record.payload for _, _, record in split_records(await hear_bytes(socket))]
            assert frames == MESSAGES[:2]
            await foxglove.subscribe(7, TOPIC)
            stub = telemetry_pb2_grpc.TelemetryServiceStub(opened)
            metadata = tuple((name.lower(), value) for name, value in bearer(KEY).items())
            request = telemetry_pb2.SubscribeRequest(robots=["sim_1"], topics=[TOPIC])
            call = stub.Subscribe(request, metadata=metadata, timeout=60)
            reading = asyncio.create_task(by_grpc(call, 6))
            await asked(agent, viewers=3, key_frames=2)
            await agent.samples(1, 3, MESSAGES[2:])
            assert await by_foxglove(foxglove, 6) == MESSAGES[6:]
            assert await reading == MESSAGES[6:]
            while len(frames) < 12:
                frames += [record.payload for _, _, record in split_records(await hear_bytes(socket))]
            assert frames == MESSAGES
            call.cancel()
