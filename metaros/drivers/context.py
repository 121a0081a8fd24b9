"""The API between the driver host and a driver kind: `make(context)` returns a Device."""

from __future__ import annotations

import threading
from collections.abc import Callable
from typing import TYPE_CHECKING, Any, Protocol

from metaros.clock import Clock
from metaros.drivers.faults import FaultBox
from metaros.drivers.log_throttle import LogThrottle
from metaros.drivers.manifest import Manifest
from metaros.drivers.status import DriverStatus
from metaros.errors import UnavailableError
from metaros.interfaces.builtin_interfaces.msg import Time
from metaros.wire import QoSProfile, qos_default, qos_sensor_data

if TYPE_CHECKING:
    from metaros.node import Publisher, Subscription
    from metaros.node.lifecycle import LifecycleNode

__all__ = ["Device", "DriverContext", "DriverPublisher"]


class Device(Protocol):
    """One device. `make` (in the kind's module `driver`) creates its topics by the context; the rest is called on the
    driver's own thread, again and again until the driver stops.
    """

    def open(self) -> None:
        """Reach the device; UnavailableError where it is not there now."""

    def run(self) -> None:
        """Work until `context.stopping`; UnavailableError when the device has gone."""

    def close(self) -> None:
        """Let the device go; also called after a failed `open`, and twice. It never waits long."""


class DriverPublisher:
    """Publishes readings while the driver is active; each one counts as a sign of life of the device."""

    def __init__(self, context: DriverContext, publisher: Publisher, *, reading: bool) -> None:
        self._context = context
        self._publisher = publisher
        self._reading = reading
        self.topic = publisher.topic

    def publish(self, message: Any, *, stamp_ns: int | None = None, farewell: bool = False) -> None:
        """Send one message, unless the driver is silenced. A `farewell` goes out also while the driver stops: the zero
        that stops a base, the state that outputs are left in.
        """
        context = self._context
        if "silent" in context.faults.on or not (context.active or farewell):
            return
        self._publisher.publish(message, stamp_ns=stamp_ns)
        if self._reading:
            context.status.reading()

    def close(self) -> None:
        """Leave the graph."""
        self._publisher.close()


class DriverContext:
    """One configured driver: its node, parameters, clock and status. Made anew at each configure."""

    def __init__(self, node: LifecycleNode, manifest: Manifest, *, status: DriverStatus, faults: FaultBox) -> None:
        self.node = node
        self.manifest = manifest
        self.status = status
        self.faults = faults
        self.clock: Clock = node.clock
        self.log = node.get_logger()
        self.stop = threading.Event()
        self._log_throttle = LogThrottle(self.clock)
        self._endpoints: list[Any] = []
        self._changes: dict[str, list[Callable[[Any], object]]] = {}

    @property
    def standing(self) -> DriverStatus:
        """The former name of `status`, for drivers that were made from an older template."""
        return self.status

    # -- parameters ------------------------------------------------------------------------------------------------

    def __getitem__(self, name: str) -> Any:
        """A parameter's value, now, in the manifest's type."""
        return self.node.parameters[name]

    def on_change(self, name: str, callback: Callable[[Any], object]) -> None:
        """Call `callback(value)` on the executor's thread when a `live` parameter has changed."""
        self._changes.setdefault(name, []).append(callback)

    def changed(self, name: str, value: Any) -> None:
        """The host tells of a change."""
        for callback in self._changes.get(name, ()):
            callback(value)

    # -- endpoints: closed by the host at clean-up -----------------------------------------------------------------

    def publisher(
        self, message_type: type[Any], topic: str, qos: QoSProfile | int = qos_sensor_data, *, reading: bool = True
    ) -> DriverPublisher:
        """A publisher of the node. `reading=False`: what is sent there is no sign of life of the device."""
        made = DriverPublisher(self, self.node.create_publisher(message_type, topic, qos), reading=reading)
        self._endpoints.append(made)
        return made

    def subscription(
        self,
        message_type: type[Any],
        topic: str,
        callback: Callable[..., Any],
        qos: QoSProfile | int = qos_default,
        **options: Any,
    ) -> Subscription:
        """Call `callback(message)` on the executor's thread (`dedicated=True`: on one of its own) while active."""

        def guarded(message: Any) -> None:
            if self.active:
                callback(message)

        made = self.node.create_subscription(message_type, topic, guarded, qos, **options)
        self._endpoints.append(made)
        return made

    def service(self, service_type: type[Any], name: str, callback: Callable[[Any, Any], Any]) -> None:
        """Serve `name` by `callback(request, response)`, on the executor's thread."""
        self._endpoints.append(self.node.create_service(service_type, name, callback))

    def timer(self, period_s: float, callback: Callable[[], Any]) -> None:
        """Call `callback()` on the executor's thread."""
        self._endpoints.append(self.node.create_timer(period_s, callback))

    def release(self, endpoint: DriverPublisher | Subscription) -> None:
        """Take back one endpoint before the others."""
        if endpoint in self._endpoints:
            self._endpoints.remove(endpoint)
            endpoint.close()

    def close(self) -> None:
        """Take back all endpoints."""
        while self._endpoints:
            endpoint = self._endpoints.pop()
            (endpoint.close if hasattr(endpoint, "close") else endpoint.cancel)()

    # -- time ------------------------------------------------------------------------------------------------------

    @property
    def active(self) -> bool:
        """Whether the driver is to publish and to obey."""
        return not self.stop.is_set()

    @property
    def stopping(self) -> bool:
        """Whether `run` is to return now. UnavailableError while a simulated fault unplugs the device."""
        if "unplug" in self.faults.on:
            raise UnavailableError("unplugged (simulated)")
        return self.stop.is_set()

    def wait(self, seconds: float) -> bool:
        """Wait; true when `run` is to return."""
        self.stop.wait(max(0.0, seconds))
        return self.stopping

    def stamp(self, stamp_ns: int | None = None) -> Time:
        """A moment as headers have it; now without one."""
        seconds, nanoseconds = divmod(self.clock.wall_ns() if stamp_ns is None else stamp_ns, 1_000_000_000)
        return Time(sec=seconds, nanosec=nanoseconds)

    # -- status: what diagnostics report ---------------------------------------------------------------------------

    def opened(self, detail: str, *, hardware_id: str = "") -> None:
        """The device answers: say so, and which it is."""
        self.status.opened(detail, hardware_id)
        if self._log_throttle.should_log(detail):
            self.log.info(f"{self.manifest.kind}: {detail}")

    def count(self, name: str, by: int = 1) -> None:
        """Add to a counter, such as `bad_checksum`."""
        self.status.count(name, by)

    def fact(self, name: str, value: object) -> None:
        """Note something worth telling, such as a firmware version."""
        self.status.facts[name] = str(value)

    def warn(self, text: str) -> None:
        """What is wrong though the device works; an empty text: nothing any more."""
        if text and text != self.status.warning and self._log_throttle.should_log(text):
            self.log.warn(f"{self.manifest.kind}: {text}")
        self.status.warning = text

    def heard(self, data: bytes) -> bytes:
        """Count what came over the wire, and garble it where that fault is simulated."""
        self.status.count("bytes_read", len(data))
        return self.faults.garbled(data) if self.faults.on else data
