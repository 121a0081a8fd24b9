"""The client of an action's results: what was told of a goal before its end is heard before its end."""

from __future__ import annotations

from collections.abc import Coroutine
from inspect import isawaitable
from typing import Any

from metaros.ros2.rclpy.core.client import Client
from metaros.ros2.rclpy.core.handles import SubscriptionHandle
from metaros.ros2.rclpy.execution.task import Future

__all__ = ["ResultClient"]


class ResultClient(Client):
    """Hands the feedback that has arrived to its callbacks before it completes the future of a result.

    Both come in one callback group; without this the last feedback of a goal would often be too late.
    """

    feedback: SubscriptionHandle

    def _deliver(self, future: Future[Any], response: Any) -> Coroutine[Any, Any, None] | None:
        if any(mailbox.pending for mailbox in self.feedback.mailboxes):
            return self._deliver_after_feedback(future, response)
        future.set_result(response)
        return None

    async def _deliver_after_feedback(self, future: Future[Any], response: Any) -> None:
        try:
            for mailbox in self.feedback.mailboxes:
                for _ in range(len(mailbox.pending)):  # what comes meanwhile need not be waited for
                    try:
                        item = mailbox.pending.popleft()
                    except IndexError:  # another thread took it
                        break
                    handled = mailbox.handle(item)
                    if isawaitable(handled):
                        await handled
        finally:
            if not future.done():
                future.set_result(response)
