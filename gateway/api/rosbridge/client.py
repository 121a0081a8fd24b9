"""What the parts of one rosbridge connection share: its access to robots, what is sent to it, and its running tasks."""

from __future__ import annotations

import asyncio
import logging
from collections.abc import Coroutine
from typing import Any

from gateway.api.robot_access import RobotAccess
from gateway.api.rosbridge.protocol import PLAIN, Frame, Protocol
from gateway.api.rosbridge.requests import Shape
from gateway.api.services import Services
from gateway.api.ws.send_queue import SendQueue
from gateway.errors import GatewayError, TooManyError
from metaros.errors import MetarosError

__all__ = ["MAX_UNDER_WAY", "Client"]

log = logging.getLogger(__name__)
MAX_UNDER_WAY = 64  # calls, goals and offers of one client that are being made at a time


class Client:
    """One connection. Lives on the event loop."""

    def __init__(self, access: RobotAccess, protocol: Protocol, send_queue: SendQueue) -> None:
        self.access = access
        self._protocol = protocol
        self._send_queue = send_queue
        self._tasks: set[asyncio.Task[None]] = set()

    @property
    def services(self) -> Services:
        """The gateway's features."""
        return self.access.services

    @property
    def now_ns(self) -> int:
        """Wall clock."""
        return self.services.clock.wall_ns()

    def say(self, message: dict[str, Any], shape: Shape = PLAIN) -> None:
        """Send an op; what is None in it is left out."""
        self.send(self._protocol.answer({name: value for name, value in message.items() if value is not None}, shape))

    def status(self, level: str, text: str, about: str | None = None) -> None:
        """Send a status, if the client wants that level."""
        self.send(self._protocol.status(level, text, about))

    def fault(self, error: MetarosError, about: str | None = None) -> None:
        """Send the status of an error."""
        self.send(self._protocol.fault(error, about))

    def send(self, frames: list[Frame]) -> None:
        """Send ready-made frames."""
        for is_text, payload in frames:
            if is_text:
                self._send_queue.text(payload)
            else:
                self._send_queue.binary(payload)

    def spawn(self, work: Coroutine[Any, Any, None], about: str | None = None) -> None:
        """Do it beside the reading of further requests; what it raises becomes a status.

        Raises:
            TooManyError: so much is under way already.
        """
        if len(self._tasks) >= MAX_UNDER_WAY:
            work.close()
            raise TooManyError(f"{MAX_UNDER_WAY} requests of yours are under way already")
        task = asyncio.create_task(self._guarded(work, about))
        self._tasks.add(task)
        task.add_done_callback(self._tasks.discard)

    async def close(self) -> None:
        """Give up what is under way."""
        tasks = list(self._tasks)
        for task in tasks:
            task.cancel()
        await asyncio.gather(*tasks, return_exceptions=True)

    async def _guarded(self, work: Coroutine[Any, Any, None], about: str | None) -> None:
        try:
            await work
        except MetarosError as error:
            self.fault(error, about)
        except Exception:
            log.exception("a rosbridge request failed")
            self.fault(GatewayError("the gateway failed; see its log"), about)
