"""The driver: receives one vehicle's messages over one link, publishes telemetry, sends the allowed commands."""

from __future__ import annotations

from pathlib import Path
from typing import Any, Final

from pymavlink.dialects.v20 import ardupilotmega as dialect

from metaros.drivers.context import DriverContext
from metaros.drivers.mavlink.codec import Codec, signing_key
from metaros.drivers.mavlink.telemetry import STREAMS, Telemetry
from metaros.drivers.mavlink.transports import Transport, check_link, open_transport
from metaros.drivers.mavlink.vehicle import LOST_S, Vehicle
from metaros.drivers.mavlink.vehicle_control import VehicleControl
from metaros.errors import ConfigError, UnavailableError

__all__ = ["MavlinkDevice", "make"]

HEARTBEAT_S: Final = 1.0
ASK_AGAIN_S: Final = 10.0  # for telemetry that does not come: an autopilot that has rebooted sends its own rates


def make(context: DriverContext) -> MavlinkDevice:
    """A vehicle on the link of the parameters."""
    return MavlinkDevice(context)


class MavlinkDevice:
    """Working means that the vehicle's heartbeat comes; without one for LOST_S seconds it is away."""

    def __init__(self, context: DriverContext) -> None:
        self._context = context
        check_link(context["link"])
        self._us = (context["system_id"], dialect.MAV_COMP_ID_MISSIONPLANNER)
        key = _key(context["signing_key_file"])
        self._codec = Codec(
            system=self._us[0], component=self._us[1], count=context.count, key=key, wall_ns=context.clock.wall_ns()
        )
        self._vehicle = Vehicle(context)
        self._telemetry = Telemetry(context)
        self._control = VehicleControl(context, self._vehicle, self._send)
        self._transport: Transport | None = None
        self._heartbeat_s = self._streams_s = 0.0
        self._received: set[int] = set()

    def open(self) -> None:
        """Open the link and wait for the vehicle's heartbeat."""
        context, link = self._context, self._context["link"]
        self._codec.clear()
        self._telemetry.forget()
        self._control.forget()
        self._heartbeat_s = self._streams_s = 0.0
        self._transport = open_transport(context, link, context["baud"])
        until_s = context.clock.monotonic_s() + LOST_S
        while not self._vehicle.connected:
            if context.stopping:
                return
            if context.clock.monotonic_s() > until_s:
                raise UnavailableError(f"no heartbeat of a vehicle on {link}")
            self._step()
        state, target = self._vehicle.state, self._vehicle.target
        assert target is not None
        context.opened(f"{state.autopilot} {state.vehicle} {target[0]}.{target[1]} on {link}")

    def run(self) -> None:
        """Receive and send until the vehicle is lost."""
        context = self._context
        while not context.stopping:
            self._step()
            self._control.work()
            self._ask_for_telemetry()
            if not self._vehicle.connected:
                raise UnavailableError(f"no heartbeat for {LOST_S:g} s")

    def close(self) -> None:
        """Let the vehicle stand still, close the link."""
        transport = self._transport
        if transport is not None:
            try:
                self._control.rest()
            except UnavailableError:
                pass  # it is gone: its autopilot stops by itself when velocities end
            finally:
                self._transport = None
                transport.close()
        self._control.forget()
        self._vehicle.lost()

    # -- the wire --------------------------------------------------------------------------------------------------

    def _step(self) -> None:
        transport, now_s = self._transport, self._context.clock.monotonic_s()
        assert transport is not None
        if now_s >= self._heartbeat_s:
            self._heartbeat_s = now_s + HEARTBEAT_S
            self._send(
                dialect.MAVLink_heartbeat_message(
                    dialect.MAV_TYPE_GCS, dialect.MAV_AUTOPILOT_INVALID, 0, 0, dialect.MAV_STATE_ACTIVE, 3
                )
            )
        for message in self._codec.feed(transport.read()):
            if self._vehicle.is_from(message):
                self._take(transport, message)

    def _take(self, transport: Transport, message: Any) -> None:
        kind = message.get_type()
        self._received.add(message.get_msgId())
        if kind == "HEARTBEAT":
            transport.adopt()
            self._vehicle.on_heartbeat(message)
        elif kind == "COMMAND_ACK":
            self._control.commands.answer(message, self._us)
        else:
            self._telemetry.take(message)

    def _send(self, message: Any) -> None:
        transport = self._transport
        if transport is None:
            raise UnavailableError("the link is closed")
        transport.write(self._codec.pack(message))

    def _ask_for_telemetry(self) -> None:
        now_s, rate, target = self._context.clock.monotonic_s(), self._context["rate"], self._vehicle.target
        if now_s < self._streams_s or rate <= 0 or target is None:
            return
        asked_before, self._streams_s = self._streams_s > 0, now_s + ASK_AGAIN_S
        received, self._received = self._received, set()
        for message_id, share in STREAMS.items():
            if not (asked_before and message_id in received):
                period_us = 1e6 / max(1.0, rate * share)
                self._send(
                    dialect.MAVLink_command_long_message(
                        *target, dialect.MAV_CMD_SET_MESSAGE_INTERVAL, 0, float(message_id), period_us, *[0.0] * 5
                    )
                )


def _key(path: str) -> bytes:
    if not path:
        return b""
    try:
        text = Path(path).read_text(encoding="ascii")
    except (OSError, UnicodeDecodeError) as error:
        raise ConfigError(
            f"mavlink: signing_key_file: {path}: {getattr(error, 'strerror', None) or 'not text'}"
        ) from None
    return signing_key(text, f"mavlink: {path}")
