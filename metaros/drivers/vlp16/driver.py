"""VLP-16: one PointCloud2 a turn, filtered, and a quantised one beside it where asked for."""

from __future__ import annotations

import ipaddress
from typing import Final

import numpy as np
import numpy.typing as npt

from metaros.convert.points import numpy_to_points
from metaros.convert.quantized import numpy_to_quantized
from metaros.drivers.context import Device, DriverContext, DriverPublisher
from metaros.drivers.vlp16.filters import CloudFilter
from metaros.drivers.vlp16.packets import RETURN_MODES
from metaros.drivers.vlp16.receiver import Receiver
from metaros.drivers.vlp16.revolutions import RawRevolution, decode
from metaros.errors import ConfigError
from metaros.interfaces.metaros_msgs.msg import QuantizedCloud
from metaros.interfaces.sensor_msgs.msg import PointCloud2
from metaros.wire import qos_reliable_all, qos_sensor_data

__all__ = ["Vlp16", "make"]

TAKE_S: Final = 0.1
_FILTERS: Final = (
    "range_min_m",
    "range_max_m",
    "z_min_m",
    "z_max_m",
    "sector_from_deg",
    "sector_to_deg",
    "voxel_m",
)


class Vlp16:
    """Takes turns from the receiver's queue, decodes and publishes them."""

    def __init__(self, context: DriverContext) -> None:
        self._context = context
        qos = qos_sensor_data if context["delivery"] == "latest" else qos_reliable_all
        self._points = context.publisher(PointCloud2, context["topic"], qos)
        self._quantized: DriverPublisher | None = None
        if context["quantized_step_m"] > 0:
            self._quantized = context.publisher(QuantizedCloud, f"{context['topic']}/quantized", qos, reading=False)
        self._receiver: Receiver | None = None
        self._filter = self._read_filter()
        for name in _FILTERS:
            context.on_change(name, self._on_filter)

    def open(self) -> None:
        """Listen; the device sends by itself."""
        context = self._context
        self._receiver = Receiver(
            context,
            bind=context["bind"],
            port=context["port"],
            position_port=context["position_port"],
            device=context["device"],
            newest_only=context["delivery"] == "latest",
        )
        context.fact("receive_buffer_bytes", self._receiver.buffer_bytes)
        context.fact("udp_port", self._receiver.port)
        context.opened(f"listening on UDP {context['bind']}:{self._receiver.port}")

    def run(self) -> None:
        """Decode and publish until the driver stops."""
        assert self._receiver is not None
        while not self._context.stopping:
            turn = self._receiver.take(TAKE_S)
            if turn is not None:
                self._publish(turn)

    def close(self) -> None:
        """Stop listening."""
        receiver, self._receiver = self._receiver, None
        if receiver is not None:
            receiver.close()

    def _publish(self, turn: RawRevolution) -> None:
        context = self._context
        points = self._filter.apply(decode(turn))
        frame_id = context["frame_id"]
        context.fact("points", len(points))
        context.fact("returns", RETURN_MODES[turn.mode])
        self._points.publish(numpy_to_points(points, stamp_ns=turn.stamp_ns, frame_id=frame_id), stamp_ns=turn.stamp_ns)
        if self._quantized is not None:
            self._quantized.publish(
                _quantized(points, context["quantized_step_m"], turn.stamp_ns, frame_id), stamp_ns=turn.stamp_ns
            )

    def _on_filter(self, _: object) -> None:
        self._filter = self._read_filter()

    def _read_filter(self) -> CloudFilter:
        return CloudFilter(**{name: self._context[name] for name in _FILTERS})


def _quantized(points: npt.NDArray[np.void], step_m: float, stamp_ns: int, frame_id: str) -> QuantizedCloud:
    return numpy_to_quantized(points, step_m=step_m or 0.01, stamp_ns=stamp_ns, frame_id=frame_id)


def make(context: DriverContext) -> Device:
    """The driver's device; ConfigError: bounds that exclude each other, an address that is none."""
    if context["range_min_m"] >= context["range_max_m"] or context["z_min_m"] >= context["z_max_m"]:
        raise ConfigError("vlp16: range_min_m must be below range_max_m, and z_min_m below z_max_m")
    for name in ("bind", "device"):
        try:
            ipaddress.ip_address(context[name] or "0.0.0.0")
        except ValueError:
            raise ConfigError(f"vlp16: {name}: {context[name]!r} is no IP address") from None
    return Vlp16(context)
