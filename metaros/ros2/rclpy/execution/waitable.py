"""`rclpy.waitable`: things of a program's own that an executor waits for and runs."""

from __future__ import annotations

from typing import Any, Generic, TypeVar

from metaros.executor import CallbackGroup

__all__ = ["NumberOfEntities", "Waitable"]

T = TypeVar("T")


class NumberOfEntities:
    """How many of each kind a waitable puts into a wait set."""

    __slots__ = ("num_clients", "num_events", "num_guard_conditions", "num_services", "num_subscriptions", "num_timers")

    def __init__(
        self,
        num_subs: int = 0,
        num_gcs: int = 0,
        num_timers: int = 0,
        num_clients: int = 0,
        num_services: int = 0,
        num_events: int = 0,
    ) -> None:
        self.num_subscriptions = num_subs
        self.num_guard_conditions = num_gcs
        self.num_timers = num_timers
        self.num_clients = num_clients
        self.num_services = num_services
        self.num_events = num_events

    def _counts(self) -> tuple[int, ...]:
        return (
            self.num_subscriptions,
            self.num_guard_conditions,
            self.num_timers,
            self.num_clients,
            self.num_services,
            self.num_events,
        )

    def __add__(self, other: NumberOfEntities) -> NumberOfEntities:
        pairs = zip(self._counts(), other._counts(), strict=True)
        return type(self)(*[mine + others for mine, others in pairs])

    def __iadd__(self, other: NumberOfEntities) -> NumberOfEntities:
        for name in NumberOfEntities.__slots__:
            setattr(self, name, getattr(self, name) + getattr(other, name))
        return self

    def __repr__(self) -> str:
        return f"<{type(self).__name__}({', '.join(map(str, self._counts()))})>"


class Waitable(Generic[T]):
    """Subclass it and `node.add_waitable` it: it puts what it waits for into a wait set and says when it is ready.

    Then `take_data()` is called, and `await execute(data)` in its turn, as the callback group allows.
    """

    def __init__(self, callback_group: CallbackGroup) -> None:
        self.callback_group = callback_group
        self._futures: list[Any] = []
        add = getattr(callback_group, "add_entity", None)
        if add is not None:
            add(self)

    def __enter__(self) -> Any:
        """Keep what it waits for from being destroyed; a subclass says how."""
        return None

    def __exit__(self, *_: object) -> None:
        """The reverse."""

    def add_future(self, future: Any) -> None:
        """Run this future's callbacks on the executor that runs the waitable."""
        self._futures.append(future)

    def remove_future(self, future: Any) -> None:
        """The reverse of `add_future`; ValueError where it was not added."""
        self._futures.remove(future)

    def is_ready(self, wait_set: Any) -> bool:
        """Whether there is something to execute, by what of the wait set is ready."""
        raise NotImplementedError("Must be implemented by subclass")

    def take_data(self) -> T:
        """What to execute: taken, so that the wait set is not ready for its sake again."""
        raise NotImplementedError("Must be implemented by subclass")

    async def execute(self, taken_data: T) -> None:
        """Do it."""
        raise NotImplementedError("Must be implemented by subclass")

    def get_num_entities(self) -> NumberOfEntities:
        """How much it puts into a wait set."""
        raise NotImplementedError("Must be implemented by subclass")

    def add_to_wait_set(self, wait_set: Any) -> None:
        """Put it there."""
        raise NotImplementedError("Must be implemented by subclass")
