"""Driving a robot: the lease lives as long as the stream, whose end, however it comes, stops the robot."""

from __future__ import annotations

import asyncio
import queue
from collections.abc import AsyncIterator, Iterator
from typing import Any

from metaros._proto import fleet_pb2

__all__ = ["AsyncDrive", "Drive"]


class Drive:
    """Call `move` several times a second: the robot stops 300 ms after the last one."""

    def __init__(self, robot: str, holder: str) -> None:
        self.lease_id = ""
        self._robot, self._holder = robot, holder  # of the first message
        self._requests: queue.SimpleQueue[fleet_pb2.DriveRequest | None] = queue.SimpleQueue()
        self._replies: Any = None

    def open(self, call: Any) -> None:
        """Take the lease: `call` makes the stream out of what is sent. The robot stands."""
        self._replies = call(self._sent())
        self.move()

    def move(self, *, linear: float = 0.0, angular: float = 0.0) -> None:
        """Drive at so many m/s and rad/s; raises the stream's error when the lease is lost."""
        self._requests.put(request_of(self._robot, self._holder, linear, angular))
        self._robot = self._holder = ""
        self.lease_id = next(self._replies).lease_id

    def close(self) -> None:
        """Stop, and give the lease back."""
        self._requests.put(None)
        for _ in self._replies or ():
            pass

    def cancel(self) -> None:
        """Stop at once."""
        self._requests.put(None)
        if self._replies is not None:
            self._replies.cancel()

    def _sent(self) -> Iterator[fleet_pb2.DriveRequest]:
        while (request := self._requests.get()) is not None:
            yield request


class AsyncDrive:
    """The same for asyncio."""

    def __init__(self, robot: str, holder: str) -> None:
        self.lease_id = ""
        self._robot, self._holder = robot, holder  # of the first message
        self._requests: asyncio.Queue[fleet_pb2.DriveRequest | None] = asyncio.Queue()
        self._call: Any = None
        self._replies: Any = None

    async def open(self, call: Any) -> None:
        """Take the lease; the robot stands."""
        self._call = call(self._sent())
        self._replies = aiter(self._call)
        await self.move()

    async def move(self, *, linear: float = 0.0, angular: float = 0.0) -> None:
        """Drive at so many m/s and rad/s; raises the stream's error when the lease is lost."""
        await self._requests.put(request_of(self._robot, self._holder, linear, angular))
        self._robot = self._holder = ""
        self.lease_id = (await anext(self._replies)).lease_id

    async def close(self) -> None:
        """Stop, and give the lease back."""
        await self._requests.put(None)
        async for _ in self._replies:
            pass

    def cancel(self) -> None:
        """Stop at once."""
        if self._call is not None:
            self._call.cancel()

    async def _sent(self) -> AsyncIterator[fleet_pb2.DriveRequest]:
        while (request := await self._requests.get()) is not None:
            yield request


def request_of(robot: str, holder: str, linear: float, angular: float) -> fleet_pb2.DriveRequest:
    """One message of the stream."""
    return fleet_pb2.DriveRequest(robot=robot, holder=holder, linear=linear, angular=angular)
