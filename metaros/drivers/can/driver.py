"""The driver: publishes what is on the bus, and sends what the robot's own settings allow."""

from __future__ import annotations

from typing import Any, Final

import can
import numpy as np

from metaros.drivers.can.bus import PythonCanBus, SlcanBus, open_bus
from metaros.drivers.can.identifiers import MOST_IDS, read_ids
from metaros.drivers.can.latest import Latest
from metaros.drivers.can.signals import Signals
from metaros.drivers.context import DriverContext, DriverPublisher
from metaros.errors import UnavailableError
from metaros.interfaces.can_msgs.msg import Frame
from metaros.interfaces.std_msgs.msg import Float64, Header
from metaros.wire import QoSProfile, qos_default

__all__ = ["CanDevice", "make"]

_DEPTH: Final = 200


def make(context: DriverContext) -> CanDevice:
    """The bus of the parameters."""
    return CanDevice(context)


class CanDevice:
    """Sends nothing by itself, and nothing that was given while the bus was away."""

    def __init__(self, context: DriverContext) -> None:
        self._context = context
        self._bus: PythonCanBus | SlcanBus | None = None
        self._signals = Signals(context["dbc"], context["signals"]) if context["dbc"] else None
        self._frames = context.publisher(Frame, "can/rx", QoSProfile(depth=_DEPTH)) if context["frames"] else None
        self._values: dict[str, DriverPublisher] = {
            name: context.publisher(Float64, f"can/{name}", qos_default)
            for name in (self._signals.names if self._signals else ())
        }
        self._frame_gate = Latest(context["frame_rate"], most=MOST_IDS)
        self._value_gate = Latest(context["signal_rate"], most=MOST_IDS)
        self._tx_ids = read_ids(context["tx_ids"])
        if context["allow_tx"]:
            context.subscription(Frame, "can/tx", self._on_tx, QoSProfile(depth=10), dedicated=True)

    def open(self) -> None:
        """Join the bus."""
        self._bus = open_bus(self._context)
        self._context.opened(f"on {self._bus.name}")

    def run(self) -> None:
        """Receive and publish."""
        context, bus = self._context, self._bus
        assert bus is not None
        while not context.stopping:
            for message in bus.read():
                self._take(message)
            now_s = context.clock.monotonic_s()
            for _, frame in self._frame_gate.due(now_s):
                self._publish(frame)
            for name, value in self._value_gate.due(now_s):
                self._values[name].publish(Float64(data=value))

    def close(self) -> None:
        """Leave the bus."""
        bus, self._bus = self._bus, None
        if bus is not None:
            bus.close()

    # -- from the bus ----------------------------------------------------------------------------------------------

    def _take(self, message: Any) -> None:
        context, now_s = self._context, self._context.clock.monotonic_s()
        if message.is_error_frame:
            context.count("error_frames")
            context.warn("the bus has errors")
            return
        if message.is_fd:  # longer than a can_msgs/Frame can be
            context.count("fd_frames")
            return
        context.warn("")
        if self._frames is not None:
            frame = self._frame(message)
            key = (message.arbitration_id, message.is_extended_id)
            if self._frame_gate.give(key, frame, now_s):
                self._publish(frame)
        if self._signals is not None and not message.is_remote_frame:
            self._decode(message, now_s)

    def _decode(self, message: Any, now_s: float) -> None:
        assert self._signals is not None
        try:
            found = list(
                self._signals.values(message.arbitration_id, extended=message.is_extended_id, data=bytes(message.data))
            )
        except ValueError:
            self._context.count("undecoded_frames")
            return
        for name, value in found:
            if self._value_gate.give(name, value, now_s):
                self._values[name].publish(Float64(data=value))

    def _frame(self, message: Any) -> Frame:
        data = np.zeros(8, np.uint8)
        data[: len(message.data)] = list(message.data)
        return Frame(
            header=Header(stamp=self._context.stamp(), frame_id=self._context["frame_id"]),
            id=message.arbitration_id,
            is_rtr=message.is_remote_frame,
            is_extended=message.is_extended_id,
            dlc=min(message.dlc, 8),
            data=data,
        )

    def _publish(self, frame: Frame) -> None:
        if self._frames is not None:
            self._frames.publish(frame)

    # -- from others -----------------------------------------------------------------------------------------------

    def _on_tx(self, frame: Frame) -> None:
        bus, allowed = self._bus, (frame.id, bool(frame.is_extended)) in self._tx_ids
        if bus is None or frame.is_error or frame.dlc > 8 or not allowed:
            self._context.count("refused_commands")
            return
        message = can.Message(
            arbitration_id=frame.id,
            is_extended_id=frame.is_extended,
            is_remote_frame=frame.is_rtr,
            dlc=frame.dlc,
            data=None if frame.is_rtr else bytes(frame.data[: frame.dlc]),
        )
        try:
            bus.send(message)
            self._context.count("sent_frames")
        except UnavailableError:
            self._context.count("unsent_frames")
