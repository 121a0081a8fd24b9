"""Liveliness: by token (automatic), or by renewal within a lease (manual). Pure: times are given, in seconds."""

from __future__ import annotations

from dataclasses import dataclass

from metaros.node.events.event_types import LivelinessChanged

__all__ = ["Lease", "LivelinessMonitor"]


class Lease:
    """A publisher's promise to say within every `lease_s` that it lives."""

    def __init__(self, lease_s: float, now_s: float) -> None:
        self.lost = 0
        self.alive = True
        self._lease_s = lease_s
        self._until_s = now_s + lease_s

    def renew(self, now_s: float) -> None:
        """It said so."""
        self.alive = True
        self._until_s = now_s + self._lease_s

    def check(self, now_s: float) -> bool:
        """Whether it was alive at the last check and is no more."""
        if not self.alive or now_s < self._until_s:
            return False
        self.alive = False
        self.lost += 1
        return True

    def next_check_s(self, now_s: float) -> float:
        """When a check may next find something."""
        return self._until_s if self.alive else now_s + self._lease_s


@dataclass(slots=True)
class _Publisher:
    node: str
    lease: Lease | None


class LivelinessMonitor:
    """The publishers of one subscription. One with a lease is alive while it renews in time, any other always."""

    def __init__(self, topic: str) -> None:
        self._topic = topic
        self._publishers: dict[bytes, _Publisher] = {}

    @property
    def alive(self) -> int:
        """How many are alive."""
        return sum(1 for one in self._publishers.values() if one.lease is None or one.lease.alive)

    @property
    def not_alive(self) -> int:
        """How many are in the graph and let their lease pass."""
        return len(self._publishers) - self.alive

    @property
    def leases(self) -> bool:
        """Whether any publisher has a lease to keep."""
        return any(one.lease is not None for one in self._publishers.values())

    def add(self, gid: bytes, node: str, lease_s: float | None, now_s: float) -> LivelinessChanged | None:
        """A publisher came; `lease_s` is None where its token is proof enough."""
        if gid in self._publishers:
            return None
        self._publishers[gid] = _Publisher(node, None if lease_s is None else Lease(lease_s, now_s))
        return self._changed(node, 1, 0)

    def discard(self, gid: bytes) -> LivelinessChanged | None:
        """A publisher went."""
        one = self._publishers.pop(gid, None)
        if one is None:
            return None
        was_alive = one.lease is None or one.lease.alive
        return self._changed(one.node, -1 if was_alive else 0, 0 if was_alive else -1)

    def renew(self, gid: bytes, now_s: float) -> LivelinessChanged | None:
        """A publisher said that it lives: by a sample, or by assert_liveliness."""
        one = self._publishers.get(gid)
        if one is None or one.lease is None:
            return None
        woke = not one.lease.alive
        one.lease.renew(now_s)
        return self._changed(one.node, 1, -1) if woke else None

    def check(self, now_s: float) -> list[LivelinessChanged]:
        """One event for each publisher that let its lease pass."""
        silent = [one for one in self._publishers.values() if one.lease is not None and one.lease.check(now_s)]
        after, gone = self.alive, self.not_alive
        events = []
        for number, one in enumerate(silent, 1):
            left = len(silent) - number  # those that the next events tell of
            events.append(self._event(one.node, after + left, -1, gone - left, 1))
        return events

    def next_check_s(self) -> float | None:
        """When a check may next find something; None without leases."""
        dues = [one.lease.next_check_s(0.0) for one in self._publishers.values() if one.lease and one.lease.alive]
        return min(dues, default=None)

    def _changed(self, node: str, alive_change: int, not_alive_change: int) -> LivelinessChanged:
        return self._event(node, self.alive, alive_change, self.not_alive, not_alive_change)

    def _event(
        self, node: str, alive: int, alive_change: int, not_alive: int, not_alive_change: int
    ) -> LivelinessChanged:
        return LivelinessChanged(
            topic=self._topic,
            node=node,
            alive=alive,
            alive_change=alive_change,
            not_alive=not_alive,
            not_alive_change=not_alive_change,
        )
