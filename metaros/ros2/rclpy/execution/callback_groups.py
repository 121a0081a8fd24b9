"""`rclpy.callback_groups`: which callbacks may run at the same time, as rclpy tells it.

They are groups of the library as well, so that its subscriptions and services take them as they are.
"""

from __future__ import annotations

import threading
import weakref
from typing import Any

from metaros.executor import groups

__all__ = ["CallbackGroup", "MutuallyExclusiveCallbackGroup", "ReentrantCallbackGroup"]


class CallbackGroup(groups.CallbackGroup):
    """The root of groups. One of your own says when something `can_execute`, and is told of its beginning and end.

    An entity is a subscription, timer, client, service, guard condition or waitable.
    """

    def __init__(self) -> None:
        super().__init__()
        self.entities: set[weakref.ref[Any]] = set()

    def add_entity(self, entity: Any) -> None:
        """It belongs to this group from now on; the group does not keep it alive."""
        self.entities.add(weakref.ref(entity, self.entities.discard))

    def has_entity(self, entity: Any) -> bool:
        """Whether it was added."""
        return weakref.ref(entity) in self.entities

    def can_execute(self, entity: Any) -> bool:
        """Whether a callback of the entity may run now."""
        raise NotImplementedError

    def beginning_execution(self, entity: Any) -> bool:
        """A callback of the entity would run now: True lets it, and `ending_execution` will tell when it is done."""
        raise NotImplementedError

    def ending_execution(self, entity: Any) -> None:
        """What `beginning_execution` let run is done."""
        raise NotImplementedError

    def enter(self, job: Any) -> bool:
        """As `beginning_execution`, for executors of the library."""
        return self.beginning_execution(job)

    def leave(self) -> Any:
        """As `ending_execution`; nobody waits in line."""
        self.ending_execution(None)


class ReentrantCallbackGroup(CallbackGroup):
    """Callbacks of this group run whenever a thread is free, several of one entity at once included."""

    overlap = groups.REENTRANT_COROUTINES

    def can_execute(self, entity: Any) -> bool:
        """Always."""
        return True

    def beginning_execution(self, entity: Any) -> bool:
        """Always."""
        return True

    def ending_execution(self, entity: Any) -> None:
        """Nobody waits for that."""


class MutuallyExclusiveCallbackGroup(CallbackGroup):
    """Callbacks of this group run one at a time; one that awaits has not ended."""

    def __init__(self) -> None:
        super().__init__()
        self._active_entity: Any = None
        self._taken = False
        self._lock = threading.Lock()

    def can_execute(self, entity: Any) -> bool:
        """Whether none runs."""
        return not self._taken

    def beginning_execution(self, entity: Any) -> bool:
        """Whether none runs: then this one does."""
        with self._lock:
            if self._taken:
                return False
            self._taken, self._active_entity = True, entity
            return True

    def ending_execution(self, entity: Any) -> None:
        """The next may run."""
        with self._lock:
            self._taken, self._active_entity = False, None
