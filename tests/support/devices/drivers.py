"""A driver of any kind in a test's process: on its own executor, seen by a viewer node of the same context."""

from __future__ import annotations

import threading
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from typing import Any

import metaros
from metaros.drivers.backoff import Backoff
from metaros.drivers.diagnostics import status_of
from metaros.drivers.node import DriverNode
from metaros.drivers.registry import device_maker, manifest_of
from metaros.interfaces.diagnostic_msgs.msg import DiagnosticStatus
from tests.support.processes.clock_jump import LeapingClock
from tests.support.waiting import wait_until

__all__ = ["RETRY_S", "RunningDriver", "running"]

RETRY_S = 0.02


class RunningDriver:
    """What a test sees of a driver."""

    def __init__(self, node: DriverNode, viewer: metaros.Node, namespace: str) -> None:
        self.node = node
        self.viewer = viewer
        self.namespace = namespace.rstrip("/")

    def messages(self, message_type: type[Any], topic: str, qos: Any = metaros.qos_sensor_data) -> list[Any]:
        """A list that fills with what comes on the topic, which is relative to the namespace."""
        found: list[Any] = []
        self.viewer.create_subscription(message_type, f"{self.namespace}/{topic}", found.append, qos)
        return found

    def status(self) -> DiagnosticStatus:
        """What diagnostics tell at the next change or second."""
        return status_of(self.node.full_name, self.node.manifest.kind, self.node.status)

    def facts(self) -> dict[str, str]:
        """The values of the diagnostics: kind, state, rate_hz, facts and counters."""
        return {value.key: value.value for value in self.status().values}

    def state(self) -> str:
        """`opening`, `working`, `stale`, `waiting`, …"""
        return self.node.status.state.value

    def leap(self, seconds: float) -> None:
        """Let the driver's clock be so much later; what waits for a time-out has waited."""
        clock = self.node.clock
        assert isinstance(clock, LeapingClock)
        clock.leap(seconds)
        self.node.ingress.wake()

    def lose(self, seconds: float) -> None:
        """Leap until the driver, which hears nothing, notices that."""
        wait_until(lambda: self.state() in ("waiting", "opening") or self.leap(seconds))


@contextmanager
def running(
    kind: str,
    params: Mapping[str, Any],
    *,
    context: metaros.Context,
    namespace: str = "/r1",
    name: str = "",
    start: bool = True,
) -> Iterator[RunningDriver]:
    """Run a driver, which tries again soon, and a viewer; everything has ended when the block has."""
    make, manifest = device_maker(kind), manifest_of(kind)
    backoff = Backoff(first_s=RETRY_S, last_s=RETRY_S)
    node = DriverNode(manifest, make, params, context=context, namespace=namespace, name=name, backoff=backoff)
    viewer = metaros.Node("driver_viewer", context=context)
    executor = metaros.SingleThreadedExecutor()
    executor.add_node(node)
    executor.add_node(viewer)
    spinning = threading.Thread(target=executor.spin, name="driver test executor")
    spinning.start()
    try:
        if start:
            node.start()
        yield RunningDriver(node, viewer, namespace)
    finally:
        node.stop()
        executor.shutdown()
        spinning.join(60)
        viewer.close()
        assert not spinning.is_alive()
