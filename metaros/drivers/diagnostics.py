"""`diagnostics`: how the driver stands, as every ROS tool reads it; once a second and at each change."""

from __future__ import annotations

from typing import TYPE_CHECKING, Final

from metaros.drivers.standing import DriverState, Standing
from metaros.interfaces.builtin_interfaces.msg import Time
from metaros.interfaces.diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus, KeyValue
from metaros.interfaces.std_msgs.msg import Header

if TYPE_CHECKING:
    from metaros.node.lifecycle import LifecycleNode

__all__ = ["DIAGNOSTICS_TOPIC", "PERIOD_S", "Diagnostics", "status_of"]

DIAGNOSTICS_TOPIC: Final = "diagnostics"  # in the driver's namespace: at the root it is ROS's own /diagnostics
PERIOD_S: Final = 1.0
_LOOK_S: Final = 0.1
_LEVELS: Final = {
    DriverState.RESTING: DiagnosticStatus.OK,
    DriverState.OPENING: DiagnosticStatus.WARN,
    DriverState.WORKING: DiagnosticStatus.OK,
    DriverState.STALE: DiagnosticStatus.STALE,
    DriverState.WAITING: DiagnosticStatus.ERROR,
    DriverState.FAILED: DiagnosticStatus.ERROR,
}


class Diagnostics:
    """Publishes the standing of one driver, on the executor's thread."""

    def __init__(self, node: LifecycleNode, kind: str, standing: Standing) -> None:
        self._node = node
        self._kind = kind
        self._standing = standing
        self._told: tuple[object, ...] = ()
        self._told_s = 0.0
        self._publisher = node.create_publisher(DiagnosticArray, DIAGNOSTICS_TOPIC, 10)
        self._timer = node.create_timer(_LOOK_S, self.look)

    def look(self) -> None:
        """Tell what changed, and all of it once a second."""
        standing, now_s = self._standing, self._node.clock.monotonic_s()
        present = (standing.state, standing.detail, standing.warning)
        if present != self._told or now_s - self._told_s >= PERIOD_S:
            self._told, self._told_s = present, now_s
            self.tell()

    def tell(self) -> None:
        """Publish now."""
        seconds, nanoseconds = divmod(self._node.clock.wall_ns(), 1_000_000_000)
        header = Header(stamp=Time(sec=seconds, nanosec=nanoseconds))
        status = status_of(self._node.full_name, self._kind, self._standing)
        self._publisher.publish(DiagnosticArray(header=header, status=[status]))


def status_of(full_name: str, kind: str, standing: Standing) -> DiagnosticStatus:
    """The standing as one DiagnosticStatus: `name` is the node, the values begin with kind and state."""
    state, level = standing.state, _LEVELS[standing.state]
    message = standing.detail or state.value
    if state is DriverState.STALE:
        message = f"no reading for {standing.age_s():.1f} s"
    elif standing.warning:
        level, message = max(level, DiagnosticStatus.WARN), standing.warning
    facts = {"kind": kind, "state": state.value, "rate_hz": f"{standing.rate_hz():.3g}"}
    counters = {name: str(count) for name, count in sorted(standing.counters.copy().items())}
    values = [KeyValue(key=key, value=value) for key, value in (facts | standing.facts | counters).items()]
    return DiagnosticStatus(
        level=level, name=full_name, message=message, hardware_id=standing.hardware_id, values=values
    )
