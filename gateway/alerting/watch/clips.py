"""Evidence: a clip of the robot's black box around a severe alert's beginning, asked for once, and not too often."""

from __future__ import annotations

import asyncio
import logging
from collections import deque
from collections.abc import Awaitable, Callable, Iterable

from gateway.domain.alert import Alert
from gateway.domain.fleet.recording import Recording
from gateway.errors import TooManyError
from metaros.clock import Clock
from metaros.errors import MetarosError

__all__ = ["Clips"]

log = logging.getLogger(__name__)

BEFORE_NS, AFTER_NS = 30 * 10**9, 10 * 10**9
WAIT_S = 11.0  # the black box has what came after the beginning by then
STEP_S = 0.5
EVERY_S, DAY_S, A_DAY = 60.0, 86_400.0, 20
MAX_WAITING = 256
MAX_ROBOTS = 16_384
Request = Callable[[str, tuple[int, int]], Awaitable[Recording]]  # robot, span by its clock
Attach = Callable[[str, str], Awaitable[object]]  # alert, recording


class Clips:
    """All methods on the event loop."""

    def __init__(self, request: Request, attach: Attach, *, clock: Clock) -> None:
        self._request = request
        self._attach = attach
        self._clock = clock
        self._due: deque[tuple[float, Alert]] = deque(maxlen=MAX_WAITING)
        self._taken: dict[str, deque[float]] = {}  # when, of each robot, the robot that had one longest ago first
        self.skipped = 0

    def on_alert(self, what: str, alert: Alert) -> None:
        """An alert changed; severe ones that begin, or become it, get a clip in a while."""
        if what in ("opened", "escalated") and alert.severity == "error" and alert.robot and not alert.clip:
            self._due.append((self._clock.monotonic_s() + WAIT_S, alert))

    def resume(self, alerts: Iterable[Alert]) -> None:
        """Alerts of a former run that had just begun when it ended."""
        for alert in alerts:
            if self._clock.wall_ns() - alert.opened_ns < 60 * 10**9:
                self.on_alert("opened", alert)

    async def run(self) -> None:
        """Ask for what is due, until cancelled."""
        while True:
            await asyncio.sleep(STEP_S)
            await self.step()

    async def step(self) -> None:
        """Ask for what is due now."""
        while self._due and self._due[0][0] <= self._clock.monotonic_s():
            _, alert = self._due.popleft()
            try:
                await self.take(alert)
            except TooManyError as error:
                self.skipped += 1
                log.info("no clip of alert %s: %s", alert.id, error)
            except MetarosError as error:
                log.warning("no clip of alert %s: %s", alert.id, error)

    async def take(self, alert: Alert) -> Recording:
        """Ask the robot for a clip of an alert's beginning, and tie it to the alert.

        Raises:
            TooManyError: the robot has given one within the minute, or twenty within the day.
                GatewayError: the recording cannot be asked for, or not be tied.
        """
        self._count(alert.robot)
        recording = await self._request(alert.robot, (alert.first_ns - BEFORE_NS, alert.first_ns + AFTER_NS))
        await self._attach(alert.id, recording.id)
        return recording

    def _count(self, robot: str) -> None:
        now_s = self._clock.monotonic_s()
        taken = self._taken.pop(robot, deque(maxlen=A_DAY))
        self._taken[robot] = taken
        if taken and now_s - taken[-1] < EVERY_S:
            raise TooManyError(f"robot {robot} was asked for a clip within the last minute")
        if len(taken) == A_DAY and now_s - taken[0] < DAY_S:
            raise TooManyError(f"robot {robot} was asked for {A_DAY} clips within a day")
        taken.append(now_s)
        while len(self._taken) > MAX_ROBOTS:
            del self._taken[next(iter(self._taken))]
