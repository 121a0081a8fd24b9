"""Live samples across gateways: from those whose robots they are to those whose viewers want them."""

from __future__ import annotations

from collections.abc import Callable

from gateway.cluster.live_away import LiveAway
from gateway.cluster.live_home import LiveHome
from gateway.cluster.ports import Mesh
from gateway.domain.sample import Run
from gateway.ingest.registry import Registry
from gateway.live.hub import Hub
from metaros.clock import Clock

__all__ = ["Live"]


class Live:
    """All methods on the event loop; made before the mesh starts."""

    def __init__(self, mesh: Mesh, registry: Registry, hub: Hub, *, clock: Clock, tick_s: float = 0.005) -> None:
        self._home = LiveHome(mesh, registry, clock=clock, tick_s=tick_s)
        self._away = LiveAway(mesh, registry, hub)

    @property
    def sent_samples(self) -> int:
        """Samples that other gateways were sent since the start; one that two of them got counts twice."""
        return self._home.sent_samples

    @property
    def sent_bytes(self) -> int:
        """What that was in bytes."""
        return self._home.sent_bytes

    @property
    def dropped_samples(self) -> int:
        """Samples that were not sent, as so much waited."""
        return self._home.dropped

    @property
    def received_samples(self) -> int:
        """Samples that came from other gateways."""
        return self._away.received

    @property
    def stale_samples(self) -> int:
        """Samples that came of channels that are not known any more, or not yet."""
        return self._away.stale

    @property
    def waiting_bytes(self) -> int:
        """Samples that wait for other gateways."""
        return self._home.waiting_bytes

    def on_wanted(self, callback: Callable[[str], None]) -> None:
        """Who is told that viewers elsewhere want more of a robot, or less."""
        self._home.on_wanted = callback

    def on_key_wanted(self, callback: Callable[[str, str], None]) -> None:
        """Who is told that a viewer elsewhere needs a key frame of a robot's topic."""
        self._home.on_key_wanted = callback

    def wanted(self, robot: str) -> dict[str, float]:
        """What viewers elsewhere want of a robot: topic -> rate (0: every sample)."""
        return self._home.wanted(robot)

    def publish(self, run: Run) -> None:
        """Samples arrived here."""
        self._home.publish(run)

    def on_home(self, robot: str) -> None:
        """A robot's home, or its channels there, are news."""
        self._away.on_home(robot)

    async def run(self) -> None:
        """Until cancelled."""
        await self._away.run()
