"""Publishes on robots and calls their services, on behalf of API clients."""

from __future__ import annotations

import asyncio
from collections.abc import Callable, Iterable, Sequence
from contextlib import AbstractAsyncContextManager, nullcontext
from typing import Any

from gateway.domain.fleet.lease import LeaseTable
from gateway.errors import InvalidRequestError
from gateway.fleet.command_dispatcher import CommandDispatcher
from gateway.fleet.robots import FindRobot, require_online
from gateway.fleet.ros.errors import UnknownServiceError
from gateway.fleet.ros.graph import Endpoint, RobotGraph
from gateway.fleet.ros.typed import LARGE_BYTES, catalogue_for, decode, encode, is_large
from gateway.fleet.ros.types import TypeRegistry, full_type_name
from gateway.fleet.talk import TALK_TOPICS
from metaros._proto import link_pb2
from metaros.clock import Clock
from metaros.idl import Catalogue, default_catalogue, names, type_hash
from metaros.idl.globs import Glob
from metaros.limits import LIMITS

__all__ = ["FleetManager"]

MAX_TIMEOUT_S = 120.0

Turn = AbstractAsyncContextManager[None]


class FleetManager:
    """Resolves names and types, checks the lease on actuators, and sends the command."""

    def __init__(
        self,
        find: FindRobot,
        commands: CommandDispatcher,
        leases: LeaseTable,
        talks: LeaseTable | None = None,
        *,
        clock: Clock,
        actuator_topics: Iterable[str] = ("**/cmd_vel",),
    ) -> None:
        self._find = find
        self._commands = commands
        self._leases = leases
        self._talks = talks
        self._clock = clock
        self._actuators = tuple(Glob(pattern) for pattern in actuator_topics)
        self._talk = tuple(Glob(pattern) for pattern in TALK_TOPICS)
        self._types = TypeRegistry()
        self._graph_of: Callable[[str], RobotGraph] = lambda robot_id: RobotGraph(robot=robot_id)

    def use_graphs(self, graph_of: Callable[[str], RobotGraph]) -> None:
        """Where robots' services are told, with their types."""
        self._graph_of = graph_of

    async def publish(
        self,
        robot_id: str,
        topic: str,
        *,
        type_name: str = "",
        message: Any = None,
        cdr: bytes | None = None,
        lease_id: str = "",
        sent_ns: int = 0,
        turn: Turn | None = None,
    ) -> None:
        """Publish once on a topic of the robot; `cdr` wins over `message`. Returns after the agent's result.

        `sent_ns` is when the client made it, 0 = now: on an actuator topic the agent refuses what is too old. `turn`
        is a fair lock, held until it can be sent: what waits for the same one does not overtake it.
        """
        require_online(self._find(robot_id))
        async with turn or nullcontext():
            command = await self.publishing(
                robot_id,
                topic,
                type_name=type_name,
                message=message,
                cdr=cdr,
                lease_id=lease_id,
            )
        command.sent_ns = sent_ns
        await self._commands.run(robot_id, command, timeout_s=LIMITS.command_timeout_s)

    async def publishing(
        self,
        robot_id: str,
        topic: str,
        *,
        type_name: str = "",
        message: Any = None,
        cdr: bytes | None = None,
        lease_id: str = "",
    ) -> link_pb2.Command:
        """The command that publishes; LeaseRequiredError on an actuator topic without its lease."""
        view = self._find(robot_id)
        full = names.resolve(topic, view.robot.namespace)
        self.check_lease(robot_id, full, lease_id)
        channel = view.channel_of(full)
        heard = self._graph_of(robot_id).subscribers.get(full, ())
        if not type_name and channel is None and not heard:
            raise InvalidRequestError(f"type is missing, and robot {robot_id} announces no topic {full}")
        name = full_type_name(type_name or (channel.schema_name if channel else heard[0].type_name), "msg")
        known = self._as_heard(robot_id, name, heard)
        if cdr is not None:
            payload, type_hash = cdr, self._types.hash_of(name, channel, known)
        elif is_large(message):
            payload, type_hash = await asyncio.to_thread(self._types.encode, name, message, channel, known)
        else:
            payload, type_hash = self._types.encode(name, message, channel, known)
        publish = link_pb2.PublishMessage(topic=full, type_name=name, type_hash=type_hash, payload=payload)
        return link_pb2.Command(publish=publish, lease_id=lease_id)

    def _as_heard(self, robot_id: str, name: str, heard: Sequence[Endpoint]) -> Catalogue | None:
        """Where a message is defined as the robot's subscriptions have it, or its nodes; None where nobody told."""
        graph = self._graph_of(robot_id)
        hashes = [end.type_hash for end in heard if end.type_name == name]
        found = graph.catalogue_of(name, hashes[0]) if hashes else None
        return found if found is not None or name in default_catalogue() else graph.told(name)

    def is_actuator(self, robot_id: str, name: str) -> bool:
        """Whether a topic or service of the robot moves it, as far as the gateway's own settings say."""
        full = names.resolve(name, self._find(robot_id).robot.namespace)
        return any(glob.matches(full) for glob in self._actuators)

    async def set_uplink(self, robot_id: str, bytes_per_s: int | None) -> None:
        """Give the robot another byte budget, None for no limit; returns when its agent has taken it."""
        require_online(self._find(robot_id))
        command = link_pb2.Command(set_uplink=link_pb2.SetUplink(bytes_per_s=bytes_per_s or 0))
        await self._commands.run(robot_id, command, timeout_s=LIMITS.command_timeout_s)

    async def call(
        self,
        robot_id: str,
        service: str,
        *,
        type_name: str = "",
        request: Any = None,
        cdr: bytes | None = None,
        raw: bool = False,
        timeout_s: float = LIMITS.command_timeout_s,
        lease_id: str = "",
        sent_ns: int = 0,
        look: bool = False,
        turn: Turn | None = None,
    ) -> Any:
        """Call a service of the robot and return its response as JSON-able values, or its CDR where `raw`.

        `cdr` wins over `request`; without `type_name` the robot's graph says it. `look`: it changes nothing. `turn`:
        see `publish`.
        """
        if not 0 < timeout_s <= MAX_TIMEOUT_S:
            raise InvalidRequestError(f"timeout_s is more than 0 and at most {MAX_TIMEOUT_S:g}")
        require_online(self._find(robot_id))
        async with turn or nullcontext():
            command = await self.calling(
                robot_id, service, type_name=type_name, request=request, cdr=cdr, lease_id=lease_id
            )
        command.sent_ns = sent_ns
        result = await self._commands.run(robot_id, command, timeout_s=timeout_s, look=look)
        if raw:
            return result.payload
        if len(result.payload) > LARGE_BYTES:  # the robot chose it
            return await asyncio.to_thread(self.response, command, result.payload, robot_id)
        return self.response(command, result.payload, robot_id)

    async def calling(
        self,
        robot_id: str,
        service: str,
        *,
        type_name: str = "",
        request: Any = None,
        cdr: bytes | None = None,
        lease_id: str = "",
    ) -> link_pb2.Command:
        """The command that calls; LeaseRequiredError for a service that moves the robot, without its lease.

        UnknownServiceError when no type is given and the robot's graph has no such service.
        """
        full = names.resolve(service, self._find(robot_id).robot.namespace)
        self.check_lease(robot_id, full, lease_id)
        graph = self._graph_of(robot_id)
        info = graph.services.get(full)
        name = self.service_type(robot_id, full, type_name)
        known = info.type_hash if info is not None and info.type_name == name else ""
        catalogue = catalogue_for(graph, name, known)
        if cdr is not None:
            payload = cdr
        elif is_large(request):
            payload = await asyncio.to_thread(encode, f"{name}_Request", request, catalogue)
        else:
            payload = encode(f"{name}_Request", request, catalogue)
        call = link_pb2.CallService(
            service=full, type_name=name, type_hash=known or type_hash(name, catalogue), request=payload
        )
        return link_pb2.Command(call_service=call, lease_id=lease_id)

    def service_type(self, robot_id: str, service: str, type_name: str = "") -> str:
        """The full type of a service: the given one, else what the robot's graph says; UnknownServiceError."""
        if type_name:
            return full_type_name(type_name, "srv")
        full = names.resolve(service, self._find(robot_id).robot.namespace)
        info = self._graph_of(robot_id).services.get(full)
        if info is None:
            raise UnknownServiceError(f"type is missing, and robot {robot_id} has no service {full}")
        return info.type_name

    def response(self, command: link_pb2.Command, payload: bytes, robot_id: str = "") -> Any:
        """What a called service answered, as JSON-able values."""
        call = command.call_service
        catalogue = catalogue_for(self._graph_of(robot_id), call.type_name, call.type_hash)
        return decode(f"{call.type_name}_Response", payload, catalogue)

    def check_lease(self, robot_id: str, full: str, lease_id: str) -> None:
        """LeaseRequiredError when a topic, service or action moves the robot, or is its voice, without that lease."""
        if self._talks is not None and any(glob.matches(full) for glob in self._talk):
            self._talks.check(robot_id, lease_id, now_s=self._clock.monotonic_s())
        elif any(glob.matches(full) for glob in self._actuators):
            self._leases.check(robot_id, lease_id, now_s=self._clock.monotonic_s())
