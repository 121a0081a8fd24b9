"""What works only while its node is active: publishers that are silent else, timers that rest."""

from __future__ import annotations

from typing import Any

from metaros.executor import Timer
from metaros.node.lifecycle.state_machine import ACTIVE, ERROR_PROCESSING, State
from metaros.node.publisher import Publisher

__all__ = ["Gate", "LifecyclePublisher"]


class Gate:
    """Open from the moment the node is active until a callback has led it away, so that `on_deactivate` may still
    publish, such as a last command to stand still."""

    def __init__(self) -> None:
        self.open = False
        self._timers: list[Timer] = []

    def hold(self, timer: Timer) -> None:
        """Let the timer run only while the gate is open."""
        self._timers = [other for other in self._timers if other is not timer]
        self._timers.append(timer)
        if not self.open:
            timer.cancel()

    def entered(self, state: State) -> None:
        """The node is in another state."""
        was_open = self.open
        if state.primary or state == ERROR_PROCESSING:
            self.open = state == ACTIVE
        if self.open is was_open:
            return
        for timer in self._timers:
            if self.open:
                timer.reset()
            else:
                timer.cancel()


class LifecyclePublisher:
    """Publishes while its node is active; what is published else is counted in `silenced` and goes nowhere."""

    def __init__(self, publisher: Publisher, gate: Gate) -> None:
        self.publisher = publisher
        self.silenced = 0
        self._gate = gate

    @property
    def topic(self) -> str:
        """The full name of its topic."""
        return self.publisher.topic

    def publish(self, message: Any, *, stamp_ns: int | None = None) -> None:
        """Send one message, or not."""
        if self._gate.open:
            self.publisher.publish(message, stamp_ns=stamp_ns)
        else:
            self.silenced += 1

    def close(self) -> None:
        """Leave the graph."""
        self.publisher.close()
