"""What a Foxglove client publishes: its channels, and at most so many messages on their way to robots."""

from __future__ import annotations

import asyncio
from collections.abc import Callable, Coroutine
from typing import Any

import orjson

from gateway.api.foxglove.binary import ClientData
from gateway.api.foxglove.requests import Advertise, ClientChannel, Unadvertise
from gateway.api.foxglove.texts import ENCODINGS
from gateway.api.problem import error_code
from gateway.api.robot_access import RobotAccess
from gateway.api.rosbridge.driving import DriveLeases
from gateway.errors import InvalidRequestError
from metaros.errors import MetarosError
from metaros.limits import LIMITS

__all__ = ["Publishing"]

Start = Callable[[Coroutine[Any, Any, None]], bool]  # begin a task of the connection; False: too many are under way
Notify = Callable[[str, str], None]  # (what it is about, why it did not go)


class Publishing:
    """The client's channels. Publishing itself is RobotAccess's: permission, scope, rate, lease and audit are there."""

    def __init__(
        self,
        access: RobotAccess,
        start: Start,
        notify: Notify,
        *,
        lease_id: str = "",
        drive_leases: DriveLeases | None = None,
    ) -> None:
        """`lease_id` is the teleop lease that the client has, and `drive_leases` takes one where it said that it
        drives, both from its URL; without either, actuators are out of reach.
        """
        self._access = access
        self._drive_leases = drive_leases
        self._taking = asyncio.Lock()
        self._start = start
        self._notify = notify
        self._lease_id = lease_id
        self._channels: dict[int, ClientChannel] = {}

    def advertise(self, asked: Advertise) -> None:
        """It will publish there. InvalidRequestError: an encoding or a number cannot be."""
        for channel in asked.channels:
            self._advertise(channel)

    def unadvertise(self, asked: Unadvertise) -> None:
        """It publishes there no more."""
        for number in asked.ids:
            self._unadvertise(number)

    def _advertise(self, channel: ClientChannel) -> None:
        if channel.encoding not in ENCODINGS:
            raise InvalidRequestError(
                f"encoding {channel.encoding[:20]!r}: a client publishes {' or '.join(ENCODINGS)}"
            )
        if channel.id in self._channels:
            raise InvalidRequestError(f"Channel {channel.id} is advertised already")
        if len(self._channels) >= LIMITS.subscriptions_per_viewer:
            raise InvalidRequestError(f"a client publishes on at most {LIMITS.subscriptions_per_viewer} channels")
        self._channels[channel.id] = channel
        self._start(self._begin(channel))

    def _unadvertise(self, number: int) -> None:
        channel = self._channels.pop(number, None)
        if channel is None:
            raise InvalidRequestError(f"Unknown channel ID: {number}")
        if all(other.topic != channel.topic for other in self._channels.values()):
            self._access.unadvertise(channel.topic)

    def publish(self, data: ClientData) -> None:
        """One message; what robots do not take fast enough is told and dropped."""
        channel = self._channels.get(data.channel_id)
        if channel is None:
            raise InvalidRequestError(f"Unknown channel ID: {data.channel_id}")
        if not self._start(self._send(channel, data.payload, self._access.services.clock.wall_ns())):
            self._notify(channel.topic, "messages come faster than the robot takes them: some are dropped")

    async def _begin(self, channel: ClientChannel) -> None:
        try:
            await self._access.advertise(channel.topic, type_name=channel.schema_name)
        except MetarosError as error:
            self._notify(channel.topic, f"{error} ({error_code(error)})")

    async def close(self) -> None:
        """The client is gone: what it drives stops."""
        if self._drive_leases is not None:
            await self._drive_leases.close()

    async def _lease(self, topic: str) -> str:
        resolved, _ = self._access.find_topic(topic)
        if self._lease_id or self._drive_leases is None:
            return self._lease_id
        if not self._access.services.fleet.is_actuator(resolved.robot, resolved.name):
            return ""
        async with self._taking:
            return await self._drive_leases.lease_of(resolved.robot)

    async def _send(self, channel: ClientChannel, payload: bytes, came_ns: int) -> None:
        try:
            values: dict[str, Any] = {"cdr": payload} if channel.encoding == "cdr" else {"message": _json(payload)}
            await self._access.publish(
                channel.topic,
                type_name=channel.schema_name,
                lease_id=await self._lease(channel.topic),
                sent_ns=came_ns,
                **values,
            )
        except MetarosError as error:
            self._notify(channel.topic, f"{error} ({error_code(error)})")


def _json(payload: bytes) -> Any:
    try:
        return orjson.loads(payload)
    except orjson.JSONDecodeError as error:
        raise InvalidRequestError(f"no JSON: {error}") from None
