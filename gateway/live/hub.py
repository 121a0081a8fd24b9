"""The hub: every arriving sample to every viewer that wants it, without ever waiting for one of them."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping

from gateway.domain.channel import LIVE, Channel
from gateway.domain.records import Record
from gateway.domain.sample import Run
from gateway.live.demand import merge_rates
from gateway.live.subscription import TopicSubscription
from gateway.live.viewer import Viewer

__all__ = ["Hub"]

MAX_INDEX = 65536


class Hub:
    """Lives on the event loop; `join` gives a viewer its place and takes the callback that wakes its sender."""

    def __init__(self) -> None:
        self._viewers: dict[Viewer, Callable[[], None]] = {}
        self._index: dict[tuple[str, str], list[tuple[Viewer, TopicSubscription]]] = {}

    @property
    def viewers(self) -> int:
        """How many viewers are connected."""
        return len(self._viewers)

    def join(self, viewer: Viewer, wake: Callable[[], None]) -> None:
        """A connection opened."""
        self._viewers[viewer] = wake

    def leave(self, viewer: Viewer) -> None:
        """A connection ended."""
        self._viewers.pop(viewer, None)
        self._index.clear()

    def changed(self, viewer: Viewer) -> None:
        """A viewer's subscriptions changed."""
        self._index.clear()
        self._wake(viewer)

    def publish(self, run: Run) -> None:
        """Samples arrived: hand them to the subscriptions that want them. Payloads are copied once, for all."""
        targets = self._targets(run.channel)
        if not targets:
            return
        records: list[Record] = []
        only_newest = all(subscription.latest for _, subscription in targets)
        for seq, stamp_ns, payload in run.columns.samples():
            if not only_newest or seq == run.columns.last_seq:
                records.append(Record(seq, stamp_ns, run.receive_ns, bytes(payload)))
        for viewer, subscription in targets:
            for record in records[-1:] if subscription.latest else records:
                viewer.offer(subscription, run.channel, record)
            self._wake(viewer)

    def values(self, robot: str, values: Mapping[str, tuple[int, float]]) -> None:
        """New values of series."""
        for viewer in self._viewers:
            for subscription in viewer.metrics:
                if subscription.offer(robot, values):
                    self._wake(viewer)

    def wanted(self, channels: Iterable[Channel]) -> dict[str, float]:
        """What is wanted of a robot's live channels now: topic -> rate (0: every sample)."""
        wanted: dict[str, float] = {}
        for channel in channels:
            if channel.delivery == LIVE and channel.forward:
                rates = [subscription.max_rate_hz for _, subscription in self._targets(channel)]
                if rates:
                    wanted[channel.topic] = merge_rates(rates)
        return wanted

    def _targets(self, channel: Channel) -> list[tuple[Viewer, TopicSubscription]]:
        key = (channel.robot, channel.topic)
        targets = self._index.get(key)
        if targets is None:
            targets = [(v, item) for v in self._viewers for item in v.topics if item.wants(channel)]
            if len(self._index) >= MAX_INDEX:
                self._index.clear()
            self._index[key] = targets
        return targets

    def _wake(self, viewer: Viewer) -> None:
        wake = self._viewers.get(viewer)
        if wake is not None:
            wake()
