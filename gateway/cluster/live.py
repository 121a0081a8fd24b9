"""Live samples across gateways: from a robot's owner to the gateways whose viewers subscribe to them."""

from __future__ import annotations

from collections.abc import Callable

from gateway.cluster.live_publisher import LivePublisher
from gateway.cluster.live_subscriber import LiveSubscriber
from gateway.cluster.ports import Mesh
from gateway.domain.sample import Run
from gateway.ingest.registry import Registry
from gateway.live.hub import Hub
from metaros.clock import Clock

__all__ = ["Live"]


class Live:
    """All methods on the event loop; made before the mesh starts."""

    def __init__(self, mesh: Mesh, registry: Registry, hub: Hub, *, clock: Clock, tick_s: float = 0.005) -> None:
        self._publisher = LivePublisher(mesh, registry, clock=clock, tick_s=tick_s)
        self._subscriber = LiveSubscriber(mesh, registry, hub)

    @property
    def sent_samples(self) -> int:
        """Samples that other gateways were sent since the start; one that two of them got counts twice."""
        return self._publisher.sent_samples

    @property
    def sent_bytes(self) -> int:
        """What that was in bytes."""
        return self._publisher.sent_bytes

    @property
    def dropped_samples(self) -> int:
        """Samples that were not sent, as so much waited."""
        return self._publisher.dropped

    @property
    def received_samples(self) -> int:
        """Samples that came from other gateways."""
        return self._subscriber.received

    @property
    def stale_samples(self) -> int:
        """Samples that came of channels that are not known any more, or not yet."""
        return self._subscriber.stale

    @property
    def waiting_bytes(self) -> int:
        """Samples that wait for other gateways."""
        return self._publisher.waiting_bytes

    def on_wanted(self, callback: Callable[[str], None]) -> None:
        """Set the callback for changes in what remote viewers want of a robot."""
        self._publisher.on_wanted = callback

    def on_key_wanted(self, callback: Callable[[str, str], None]) -> None:
        """Set the callback for a remote viewer that needs a key frame of a robot's topic."""
        self._publisher.on_key_wanted = callback

    def wanted(self, robot: str) -> dict[str, float]:
        """What remote viewers want of a robot: topic -> rate (0: every sample)."""
        return self._publisher.wanted(robot)

    def publish(self, run: Run) -> None:
        """Samples arrived here."""
        self._publisher.publish(run)

    def on_owner(self, robot: str) -> None:
        """A robot's owner, or its channels there, changed."""
        self._subscriber.on_owner(robot)

    async def run(self) -> None:
        """Until cancelled."""
        await self._subscriber.run()
