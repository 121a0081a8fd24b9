"""A driver of any kind in a test's process: on its own executor, seen by a viewer node of the same context."""

from __future__ import annotations

import threading
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from typing import Any

import metaros
from metaros.drivers.node import DriverNode
from metaros.drivers.registry import device_maker, manifest_of
from metaros.interfaces.diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus

__all__ = ["RunningDriver", "running"]


class RunningDriver:
    """What a test sees of a driver."""

    def __init__(self, node: DriverNode, viewer: metaros.Node, namespace: str) -> None:
        self.node = node
        self.viewer = viewer
        self.namespace = namespace.rstrip("/")
        self._status: DiagnosticStatus | None = None
        viewer.create_subscription(DiagnosticArray, f"{self.namespace}/diagnostics", self._on_status, 10)

    def messages(self, message_type: type[Any], topic: str, qos: Any = metaros.qos_sensor_data) -> list[Any]:
        """A list that fills with what comes on the topic, which is relative to the namespace."""
        found: list[Any] = []
        self.viewer.create_subscription(message_type, f"{self.namespace}/{topic}", found.append, qos)
        return found

    def status(self) -> DiagnosticStatus:
        """The latest diagnostics; an empty one before the first."""
        return self._status or DiagnosticStatus()

    def facts(self) -> dict[str, str]:
        """The values of the latest diagnostics: kind, state, rate_hz, facts and counters."""
        return {value.key: value.value for value in self.status().values}

    def state(self) -> str:
        """`opening`, `working`, `stale`, `waiting`, …, as the diagnostics last told."""
        return self.facts().get("state", "")

    def _on_status(self, message: DiagnosticArray) -> None:
        self._status = message.status[0]


@contextmanager
def running(
    kind: str,
    params: Mapping[str, Any],
    *,
    zenoh_router: str,
    namespace: str = "/r1",
    name: str = "",
    start: bool = True,
) -> Iterator[RunningDriver]:
    """Run a driver and a viewer; everything has ended when the block has."""
    make, manifest = device_maker(kind), manifest_of(kind)
    with metaros.Context(connect=zenoh_router) as context:
        node = DriverNode(manifest, make, params, context=context, namespace=namespace, name=name)
        viewer = metaros.Node("driver_viewer", context=context)
        driver = RunningDriver(node, viewer, namespace)
        executor = metaros.SingleThreadedExecutor()
        executor.add_node(node)
        executor.add_node(viewer)
        spinning = threading.Thread(target=executor.spin, name="driver test executor")
        spinning.start()
        try:
            if start:
                node.start()
            yield driver
        finally:
            node.stop()
            executor.shutdown()
            spinning.join(60)
            assert not spinning.is_alive()
