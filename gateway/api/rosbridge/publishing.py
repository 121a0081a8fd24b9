"""What a client publishes, in the order in which it says it.

One worker takes requests one after another and starts each publish before it takes the next one; only the robots'
answers are waited for side by side. Who publishes faster than that gets a status, and what is too much is left out.
"""

from __future__ import annotations

import asyncio
from collections import deque

from gateway.api.robot_access import ResolvedName
from gateway.api.rosbridge.client import Client
from gateway.api.rosbridge.dialect import encode, types_of
from gateway.api.rosbridge.driving import DriveLeases
from gateway.api.rosbridge.requests import Advertise, Publish, Unadvertise
from gateway.domain.channel import Channel
from gateway.errors import InvalidRequestError, TooManyError
from gateway.fleet.ros.types import full_type_name
from metaros.errors import MetarosError
from metaros.idl import Catalogue, default_catalogue
from metaros.limits import LIMITS

__all__ = ["Publishing"]

LARGE_CHARS = 32 * 1024  # beyond it a message is encoded in a thread: the event loop never stops for 5 ms
MAX_WAITING = 1024
MAX_SENT = 32  # that wait for their robots' answers at a time

Request = Advertise | Publish | Unadvertise


class Publishing:
    """Of one client; `run` is its worker."""

    def __init__(self, client: Client, drive_leases: DriveLeases | None) -> None:
        """`drive_leases` takes leases on actuators, where the client said that it wants to drive."""
        self._client = client
        self._drive_leases = drive_leases
        self._waiting: deque[Request] = deque()
        self._waiting_chars = 0
        self._wake = asyncio.Event()
        self._room = asyncio.Semaphore(MAX_SENT)
        self._types: dict[ResolvedName, str] = {}  # as the client advertised

    def put(self, request: Request) -> None:
        """One more; TooManyError when so much waits already: it is left out."""
        chars = self._waiting_chars + request.chars
        if len(self._waiting) >= MAX_WAITING or chars > LIMITS.rosbridge_message_bytes:
            raise TooManyError("you publish faster than it goes to the robot: this message is left out")
        self._waiting.append(request)
        self._waiting_chars = chars
        self._wake.set()

    async def run(self) -> None:
        """Work until cancelled."""
        while True:
            while self._waiting:
                request = self._waiting.popleft()
                self._waiting_chars -= request.chars
                try:
                    await self._do(request)
                except MetarosError as error:
                    self._client.fault(error, request.id)
            self._wake.clear()
            await self._wake.wait()

    async def _do(self, request: Request) -> None:
        access = self._client.access
        if isinstance(request, Publish):
            await self._publish(request)
        elif isinstance(request, Advertise):
            type_name = full_type_name(request.type_name, "msg") if request.type_name else ""
            resolved, channel = access.find_topic(request.topic)
            if channel is not None and type_name not in ("", channel.schema_name):
                raise InvalidRequestError(f"{request.topic} has type {channel.schema_name}, and you say {type_name}")
            await access.advertise(request.topic, type_name=type_name)
            self._types[resolved] = type_name
        else:
            self._types.pop(access.find_topic(request.topic)[0], None)
            access.unadvertise(request.topic)

    async def _publish(self, request: Publish) -> None:
        resolved, channel = self._client.access.find_topic(request.topic)
        said = request.type_name or self._types.get(resolved, "")
        type_name = full_type_name(said, "msg") if said else (channel.schema_name if channel is not None else "")
        await self._client.access.advertise(request.topic, type_name=type_name)  # a row when it is the first
        catalogue, now_ns = self._catalogue(type_name, channel), self._client.now_ns
        if request.chars > LARGE_CHARS:
            cdr = await asyncio.to_thread(encode, type_name, request.message, catalogue, now_ns=now_ns)
        else:
            cdr = encode(type_name, request.message, catalogue, now_ns=now_ns)
        lease_id = request.lease_id
        if not lease_id and self._drive_leases is not None and self._moves(resolved):
            lease_id = await self._drive_leases.lease_of(resolved.robot)
        await self._room.acquire()
        try:
            self._client.spawn(self._send(request, type_name, cdr, lease_id), request.id)
        except TooManyError:
            self._room.release()
            raise

    async def _send(self, request: Publish, type_name: str, cdr: bytes, lease_id: str) -> None:
        try:
            await self._client.access.publish(
                request.topic, type_name=type_name, cdr=cdr, lease_id=lease_id, sent_ns=request.sent_ns
            )
        finally:
            self._room.release()
        self._client.status("info", f"the robot has taken it: {request.topic}", request.id)

    def _moves(self, resolved: ResolvedName) -> bool:
        return self._client.services.fleet.is_actuator(resolved.robot, resolved.name)

    def _catalogue(self, type_name: str, channel: Channel | None) -> Catalogue:
        if channel is not None and channel.schema_name == type_name:
            return types_of(channel)
        return default_catalogue()
