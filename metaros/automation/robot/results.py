"""Results to the agent, which carries them to the gateway: kept until somebody listens, then published in order.

The agent's class `event` is on its disk a moment after it receives it. Should the agent die in that moment, what it
was given is published again: to an agent that comes back by the topic's own history, and after a restart of this
program by the backlog. So a result may come twice; it has an id.
"""

from __future__ import annotations

import asyncio
import contextlib
import logging
from typing import Any, Final

from metaros.automation.robot.backlog import Backlog
from metaros.clock import Clock
from metaros.idl import message_class
from metaros.node import Node
from metaros.wire import Durability, QoSProfile, Reliability

__all__ = ["RESULTS", "Results"]

LOG = logging.getLogger("metaros.robot_functions")
RESULTS: Final = "functions/results"  # below the robot's namespace
AT_ONCE: Final = 64
HISTORY: Final = 256  # results that an agent that comes back is given again
LOOK_S: Final = 1.0
AGAIN_S: Final = 60.0  # what was handed over so shortly before this program's end is so again


class Results:
    """`run` it on the event loop; `wake` it where there is more."""

    def __init__(self, node: Node, backlog: Backlog, *, clock: Clock) -> None:
        self._backlog, self._clock, self._graph = backlog, clock, node.graph
        self._type: Any = message_class("std_msgs/msg/String")
        qos = QoSProfile(reliability=Reliability.RELIABLE, durability=Durability.TRANSIENT_LOCAL, depth=HISTORY)
        self._publisher = node.create_publisher(self._type, RESULTS, qos)
        self._wake = asyncio.Event()

    def wake(self) -> None:
        """On the loop: look again."""
        self._wake.set()

    async def run(self) -> None:
        """Until cancelled."""
        since_ns = self._clock.wall_ns() - round(AGAIN_S * 1e9)
        await asyncio.to_thread(self._backlog.send_again, since_ns=since_ns)
        while True:
            self._wake.clear()
            sent = await asyncio.to_thread(self.send_some) if self._has_listener() else 0
            if not sent:
                with contextlib.suppress(TimeoutError):
                    async with asyncio.timeout(LOOK_S):
                        await self._wake.wait()

    def send_some(self) -> int:
        """Publish some of what waits, and note it; how many. Blocks."""
        some = self._backlog.unsent(AT_ONCE)
        for result in some:
            self._publisher.publish(self._type(data=result.document))
        if some:
            now_ns = self._clock.wall_ns()
            self._backlog.sent(some, now_ns=now_ns)
            self._backlog.forget_sent(before_ns=now_ns - round(AGAIN_S * 1e9))
        return len(some)

    def _has_listener(self) -> bool:
        return bool(self._graph.endpoints(self._publisher.topic, "MS"))
