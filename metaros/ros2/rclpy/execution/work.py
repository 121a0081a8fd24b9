"""What an executor runs: each kind of it with its callback group, when it is ready, and how one run goes."""

from __future__ import annotations

import logging
import threading
from collections.abc import Callable, Coroutine, Iterable
from typing import Any, Final, Protocol

from metaros.executor import CallbackGroup, Mailbox
from metaros.executor import Timer as NativeTimer
from metaros.node.core import NodeCore
from metaros.ros2.rclpy.core.rcl_errors import InvalidHandle, TimerCancelledError
from metaros.ros2.rclpy.execution.callback_groups import MutuallyExclusiveCallbackGroup, ReentrantCallbackGroup
from metaros.ros2.rclpy.execution.inbox import InboxMail
from metaros.ros2.rclpy.execution.wait_set import mailboxes_of

__all__ = ["GuardWork", "MailWork", "NativeTimerWork", "SpunNode", "TimerWork", "WaitableWork", "Work"]

_log = logging.getLogger("metaros.ros2")
_counting = threading.Lock()
_PLAIN_GROUPS: Final = (MutuallyExclusiveCallbackGroup, ReentrantCallbackGroup)  # these do not ask who enters


class SpunNode(Protocol):
    """A node as executors see it."""

    executor: Any

    @property
    def handle(self) -> NodeCore:
        """The library's node behind it: whose mailboxes are its own."""

    @property
    def timers(self) -> Iterable[Any]:
        """Its timers."""

    @property
    def guards(self) -> Iterable[Any]:
        """Its guard conditions."""

    @property
    def waitables(self) -> Iterable[Any]:
        """Its waitables."""

    @property
    def subscriptions(self) -> Iterable[Any]:
        """Its subscriptions."""

    @property
    def services(self) -> Iterable[Any]:
        """Its services."""


class Work:
    """Something of a node that may be ready: `source`, and the `group` that says whether it may run."""

    __slots__ = ("group", "node", "source", "taken")

    def __init__(self, source: Any, group: Any, node: Any) -> None:
        self.source = source
        self.group: CallbackGroup | None = group
        self.node = node
        self.taken: Callable[[], object] | None = None  # called when it is no more ready for what runs now

    @property
    def entity(self) -> Any:
        """What callback groups and custom executors see."""
        return self.source

    def ready(self) -> bool:
        """Whether there is still something to run."""
        raise NotImplementedError

    def run(self, limit: int) -> Coroutine[Any, Any, Any] | None:
        """Run it, mail up to `limit` times; what is left to await. The group was entered before."""
        raise NotImplementedError

    def allowed(self) -> bool:
        """Whether its group would let it run now."""
        group: Any = self.group
        return group is None or group.can_execute(self.entity)

    def enter(self) -> bool:
        """Enter its group; whether that went."""
        group: Any = self.group
        return group is None or group.beginning_execution(self.entity)

    def leave(self) -> None:
        """Leave its group."""
        group: Any = self.group
        if group is not None:
            group.ending_execution(self.entity)

    def no_more_ready(self) -> None:
        """Tell whom it was handed to."""
        if self.taken is not None:
            self.taken()

    def give_back(self) -> None:
        """It is the executor's no more, run or not."""

    def began(self) -> None:
        """A coroutine of it is under way."""

    def ended(self) -> None:
        """That is done."""


class MailWork(Work):
    """A mailbox with items: of a subscription, a service, an inbox."""

    __slots__ = ("plain", "returned")

    source: Mailbox

    def __init__(self, source: Any, group: Any, node: Any) -> None:
        # Made for each turn of a subscription: without the call of the base's.
        self.source = source
        self.group = group
        self.node = node
        self.taken = None
        self.returned = False
        self.plain = type(group) in _PLAIN_GROUPS

    @property
    def entity(self) -> Any:
        """The subscription, service or client; the mailbox for groups that do not ask."""
        return self.source if self.plain else self.owner()

    def allowed(self) -> bool:
        """As of the base."""
        group: Any = self.group
        return group is None or group.can_execute(self.source if self.plain else self.owner())

    def enter(self) -> bool:
        """As of the base."""
        group: Any = self.group
        return group is None or group.beginning_execution(self.source if self.plain else self.owner())

    def leave(self) -> None:
        """As of the base."""
        group: Any = self.group
        if group is not None:
            group.ending_execution(self.source if self.plain else self.owner())

    def owner(self) -> Any:
        """The same, whatever the group."""
        mailbox = self.source
        if isinstance(mailbox, InboxMail):
            reference = mailbox.entity
            return mailbox if reference is None else reference()
        for entities in (self.node.subscriptions, self.node.services):
            for entity in entities:
                if mailbox in mailboxes_of(entity.handle):
                    return entity
        return mailbox  # of the library's own services, such as those of parameters

    def ready(self) -> bool:
        """Whether an item waits."""
        return bool(self.source.pending) and not self.source.busy

    def run(self, limit: int) -> Coroutine[Any, Any, Any] | None:
        """Items in their order, up to the first that awaits."""
        mailbox, group = self.source, self.group
        pending, handle = mailbox.pending, mailbox.handle
        if self.taken is not None:
            self.taken()
        apart = group is not None and group.overlap > 1  # the next item need not wait for this one
        for _ in range(1 if apart else min(len(pending), limit)):
            if mailbox.late_s:
                mailbox.drop_late()
            try:
                item = pending.popleft()
            except IndexError:  # the relief thread dropped it meanwhile
                return None
            if apart:
                self.began()
                self.give_back()
            try:
                result = handle(item)
            finally:
                if apart:
                    self.ended()
            if result is not None and isinstance(result, Coroutine):
                return result
        return None

    def give_back(self) -> None:
        """To the ingress, which gives it out again while there are items."""
        if not self.returned:
            self.returned = True
            self.source.owner.ingress.requeue(self.source, wake_executor=True)  # type: ignore[attr-defined]

    def began(self) -> None:
        """So many at most at a time, as the group says."""
        mailbox = self.source
        with _counting:
            mailbox.running += 1
            mailbox.busy = mailbox.running >= (1 if mailbox.group is None else mailbox.group.overlap)

    def ended(self) -> None:
        """Items may have waited for that."""
        mailbox = self.source
        with _counting:
            mailbox.running -= 1
            mailbox.busy = False
        if mailbox.pending:
            mailbox.owner.ingress.offer(mailbox)  # type: ignore[attr-defined]


class TimerWork(Work):
    """A timer that is due."""

    __slots__ = ()

    def ready(self) -> bool:
        """Whether it is due still: not cancelled, nor called meanwhile."""
        due: bool = self.source.handle.is_timer_ready()
        return due

    def run(self, limit: int) -> Coroutine[Any, Any, Any] | None:
        """Call it once."""
        try:
            call = self.source.take()
        except (InvalidHandle, TimerCancelledError):
            return None
        finally:
            self.no_more_ready()
        return _called(call)


class GuardWork(Work):
    """A guard condition that was triggered."""

    __slots__ = ()

    def ready(self) -> bool:
        """Whether it was not answered meanwhile."""
        triggered: bool = self.source.handle.triggered
        return triggered

    def run(self, limit: int) -> Coroutine[Any, Any, Any] | None:
        """Answer it."""
        call = self.source.take()
        self.no_more_ready()
        return _called(call)


class WaitableWork(Work):
    """A waitable that said that it is ready. `executor` is where its futures' callbacks are to run."""

    __slots__ = ("executor",)

    def __init__(self, source: Any, node: Any, executor: Any) -> None:
        super().__init__(source, source.callback_group, node)
        self.executor = executor

    def ready(self) -> bool:
        """It said so."""
        return True

    def run(self, limit: int) -> Coroutine[Any, Any, Any] | None:
        """Take its data and execute that."""
        waitable = self.source
        try:
            data = waitable.take_data()
        finally:
            self.no_more_ready()
        for future in getattr(waitable, "_futures", ()):
            future._set_executor(self.executor)
        result = waitable.execute(data)
        return result if isinstance(result, Coroutine) else None


class NativeTimerWork(Work):
    """A timer of the library's own on the node, such as those of deadlines: put back for its next turn already."""

    __slots__ = ()

    source: NativeTimer

    def ready(self) -> bool:
        """It was due when it was taken from its heap."""
        return not self.source.cancelled

    def run(self, limit: int) -> Coroutine[Any, Any, Any] | None:
        """Call it; what goes wrong is the library's own, and logged."""
        try:
            return _called(self.source.callback)
        except Exception:
            _log.exception("a timer's callback failed")
            return None


def _called(call: Callable[[], Any] | None) -> Coroutine[Any, Any, Any] | None:
    result = None if call is None else call()
    return result if result is not None and isinstance(result, Coroutine) else None
