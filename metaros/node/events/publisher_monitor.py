"""What a publisher offers: a deadline, and liveliness within a lease."""

from __future__ import annotations

from typing import Any

from metaros.node.endpoint import Endpoint
from metaros.node.events.callbacks import PublisherEvents
from metaros.node.events.deadline import DeadlineMonitor
from metaros.node.events.endpoint_monitor import EndpointMonitor
from metaros.node.events.event_types import DeadlineMissed, LivelinessLost
from metaros.node.events.liveliness import Lease
from metaros.node.events.timed_check import TimedCheck
from metaros.wire.qos import INFINITE_NS, Liveliness, QoSProfile

__all__ = ["PublisherMonitor", "alive_key", "lease_s"]


def lease_s(qos: QoSProfile) -> float | None:
    """The lease in which a publisher of this QoS must assert liveliness; None when its token is enough."""
    manual = qos.liveliness in (Liveliness.MANUAL_BY_TOPIC, Liveliness.MANUAL_BY_NODE)
    return qos.lease_ns / 1e9 if manual and qos.lease_ns != INFINITE_NS else None


def alive_key(data_key: str, gid: str) -> str:
    """Where a publisher says that it lives; the data key itself must carry samples only."""
    return f"{data_key}/@metaros/alive/{gid}"


class PublisherMonitor(EndpointMonitor):
    """The promises of one publisher; `sent` is None where it promises nothing, and costs nothing."""

    def __init__(self, endpoint: Endpoint, callbacks: PublisherEvents | None = None) -> None:
        super().__init__(endpoint.node, endpoint.token, callbacks, warn_once=endpoint.warn_once)
        self._endpoint = endpoint
        qos, self._clock = endpoint.qos, endpoint.node.context.clock
        period_s, lease = qos.deadline_ns / 1e9, lease_s(qos)
        self._deadline = DeadlineMonitor(period_s) if qos.deadline_ns != INFINITE_NS else None
        self._lease = None if lease is None else Lease(lease, self._clock.monotonic_s())
        promises = self._deadline is not None or self._lease is not None
        self.sent = self._sent if promises else None
        self._timed_check = TimedCheck(endpoint.node, self._check) if promises else None
        if self._timed_check is not None:
            self._timed_check.reschedule()

    @property
    def deadline_missed(self) -> int:
        """Periods without a publish."""
        self._check(self._clock.monotonic_s())
        return 0 if self._deadline is None else self._deadline.total

    @property
    def liveliness_lost(self) -> int:
        """How often the lease passed."""
        self._check(self._clock.monotonic_s())
        return 0 if self._lease is None else self._lease.lost

    def assert_alive(self) -> None:
        """The program says that the publisher lives."""
        if self._lease is None:
            return
        with self._lock:
            self._lease.renew(self._clock.monotonic_s())
        key = alive_key(self._endpoint.key, self._endpoint.gid.hex())
        self._endpoint.node.context.session.check_open().put(key, b"")

    def close(self) -> None:
        """Promise nothing more."""
        super().close()
        if self._timed_check is not None:
            self._timed_check.close()

    def _sent(self) -> None:
        now_s = self._clock.monotonic_s()
        with self._lock:
            if self._deadline is not None:
                self._deadline.mark(now_s)
            if self._lease is not None:
                self._lease.renew(now_s)

    def _check(self, now_s: float) -> float | None:
        where: dict[str, Any] = {"topic": self._endpoint.topic, "node": self._endpoint.node.full_name}
        dues: list[float] = []
        with self._lock:
            if self._deadline is not None:
                missed = self._deadline.check(now_s)
                if missed:
                    event = DeadlineMissed(**where, total=self._deadline.total, change=missed)
                    self._dispatcher.send("deadline_missed", event)
                dues.append(self._deadline.next_check_s(now_s))
            if self._lease is not None:
                if self._lease.check(now_s):
                    self._dispatcher.send("liveliness_lost", LivelinessLost(**where, total=self._lease.lost, change=1))
                dues.append(self._lease.next_check_s(now_s))
        return min(dues, default=None)
