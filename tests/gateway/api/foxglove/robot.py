"""A scripted robot with a graph, a service and a parameter, that answers what it is told."""

from __future__ import annotations

import asyncio
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from typing import Any

from gateway.main import Ready
from metaros._proto import link_pb2
from metaros.cdr import codec
from metaros.idl import default_catalogue, message_class, type_hash
from metaros.idl.json import from_json
from tests.gateway.harness import CONTROL, ScriptedAgent

__all__ = ["STRING", "TRIGGER", "Answering", "endpoint", "text"]

STRING, TRIGGER = "std_msgs/msg/String", "std_srvs/srv/Trigger"
KINDS = {
    "publisher": link_pb2.ENDPOINT_KIND_PUBLISHER,
    "subscription": link_pb2.ENDPOINT_KIND_SUBSCRIPTION,
    "server": link_pb2.ENDPOINT_KIND_SERVER,
}


def text(data: str) -> bytes:
    """A std_msgs/String as CDR."""
    return made(STRING, {"data": data})


def made(type_name: str, values: dict[str, Any]) -> bytes:
    """A message of JSON-able values as CDR."""
    catalogue = default_catalogue()
    return codec(type_name, catalogue).encode(from_json(message_class(type_name, catalogue), values))


def endpoint(number: int, kind: str, name: str, type_name: str, node: str = "/sim_1/base") -> link_pb2.GraphEndpoint:
    """One end of the graph."""
    return link_pb2.GraphEndpoint(
        number=number, kind=KINDS[kind], node=node, name=name, type_name=type_name, type_hash=type_hash(type_name)
    )


class Answering:
    """The robot: `speed` is its node's only parameter; `published` is what it was told to publish."""

    def __init__(self, agent: ScriptedAgent) -> None:
        self.agent = agent
        self.speed = 1.5
        self.published: list[tuple[str, str, bytes]] = []
        self.lease = ""
        self.released = False

    @classmethod
    @asynccontextmanager
    async def of(cls, ready: Ready, robot: str = "sim_1") -> AsyncIterator[Answering]:
        """A robot that is linked, and told its graph."""
        async with ScriptedAgent(ready, robot, session=robot.encode().ljust(16)) as agent:
            made = cls(agent)
            task = asyncio.create_task(made._run())
            await made.tell_graph(robot)
            try:
                yield made
            finally:
                task.cancel()
                await asyncio.gather(task, return_exceptions=True)

    async def tell_graph(self, robot: str, *, revision: int = 1, extra: tuple[Any, ...] = ()) -> None:
        """The graph: a base node with a topic each way, a service, and the services of parameters."""
        base = f"/{robot}/base"
        ends = [
            endpoint(1, "publisher", f"/{robot}/chatter", STRING, base),
            endpoint(2, "subscription", f"/{robot}/orders", STRING, base),
            endpoint(3, "server", f"{base}/resume", TRIGGER, base),
            endpoint(4, "server", f"{base}/list_parameters", "rcl_interfaces/srv/ListParameters", base),
            *extra,
        ]
        report = link_pb2.GraphReport(revision=revision, anew=True, nodes=[base], endpoints=ends)
        await self.agent.send(CONTROL, graph=report)

    async def _run(self) -> None:
        while True:
            command = (await self.agent.next("command", timeout_s=600)).command
            kind = command.WhichOneof("action")
            if kind == "publish":
                self.lease = command.lease_id
                self.published.append((command.publish.topic, command.publish.type_name, command.publish.payload))
                await self.agent.answer(command)
            elif kind == "call_service":
                await self.agent.answer(command, payload=self._answer(command.call_service))
            else:
                self.released = self.released or kind == "release_lease"
                await self.agent.answer(command)

    def _answer(self, call: link_pb2.CallService) -> bytes:
        response = f"{call.type_name}_Response"
        name = call.service.rpartition("/")[2]
        if name == "set_parameters":
            asked = codec(f"{call.type_name}_Request", default_catalogue()).decode(call.request)
            self.speed = asked.parameters[0].value.double_value
        values: dict[str, dict[str, Any]] = {
            "resume": {"success": True, "message": "on"},
            "list_parameters": {"result": {"names": ["speed"], "prefixes": []}},
            "describe_parameters": {"descriptors": [{"name": "speed", "type": 3}]},
            "get_parameters": {"values": [{"type": 3, "double_value": self.speed}]},
            "set_parameters": {"results": [{"successful": True, "reason": ""}]},
        }
        return made(response, values[name])
