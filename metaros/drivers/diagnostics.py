"""`diagnostics`: the driver's status as every ROS tool reads it; once a second and at each change."""

from __future__ import annotations

from typing import TYPE_CHECKING, Final

from metaros.drivers.status import DriverState, DriverStatus
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
    """Publishes the status of one driver, on the executor's thread."""

    def __init__(self, node: LifecycleNode, kind: str, status: DriverStatus) -> None:
        self._node = node
        self._kind = kind
        self._status = status
        self._reported: tuple[object, ...] = ()
        self._reported_s = 0.0
        self._publisher = node.create_publisher(DiagnosticArray, DIAGNOSTICS_TOPIC, 10)
        self._timer = node.create_timer(_LOOK_S, self.publish_changes)

    def publish_changes(self) -> None:
        """Publish when the state has changed, and once a second."""
        status, now_s = self._status, self._node.clock.monotonic_s()
        present = (status.state, status.detail, status.warning)
        if present != self._reported or now_s - self._reported_s >= PERIOD_S:
            self._reported, self._reported_s = present, now_s
            self.publish()

    def publish(self) -> None:
        """Publish now."""
        seconds, nanoseconds = divmod(self._node.clock.wall_ns(), 1_000_000_000)
        header = Header(stamp=Time(sec=seconds, nanosec=nanoseconds))
        status = status_of(self._node.full_name, self._kind, self._status)
        self._publisher.publish(DiagnosticArray(header=header, status=[status]))


def status_of(full_name: str, kind: str, status: DriverStatus) -> DiagnosticStatus:
    """The status as one DiagnosticStatus: `name` is the node, the values begin with kind and state."""
    state, level = status.state, _LEVELS[status.state]
    message = status.detail or state.value
    if state is DriverState.STALE:
        message = f"no reading for {status.age_s():.1f} s"
    elif status.warning:
        level, message = max(level, DiagnosticStatus.WARN), status.warning
    facts = {"kind": kind, "state": state.value, "rate_hz": f"{status.rate_hz():.3g}"}
    counters = {name: str(count) for name, count in sorted(status.counters.copy().items())}
    values = [KeyValue(key=key, value=value) for key, value in (facts | status.facts | counters).items()]
    return DiagnosticStatus(level=level, name=full_name, message=message, hardware_id=status.hardware_id, values=values)
