"""The driver: hears one vehicle over one link, tells what it tells, and asks of it what is allowed."""

from __future__ import annotations

from pathlib import Path
from typing import Any, Final

from pymavlink.dialects.v20 import ardupilotmega as dialect

from metaros.drivers.mavlink.codec import Codec, signing_key
from metaros.drivers.mavlink.pilot import Pilot
from metaros.drivers.mavlink.telemetry import STREAMS, Telemetry
from metaros.drivers.mavlink.vehicle import LOST_S, Vehicle
from metaros.drivers.mavlink.wires import Wire, check_link, open_wire
from metaros.drivers.unit import Unit
from metaros.errors import ConfigError, UnavailableError

__all__ = ["MavlinkDevice", "make"]

HEARTBEAT_S: Final = 1.0
ASK_AGAIN_S: Final = 10.0  # for telemetry that does not come: an autopilot that has rebooted sends its own rates


def make(unit: Unit) -> MavlinkDevice:
    """A vehicle on the link of the parameters."""
    return MavlinkDevice(unit)


class MavlinkDevice:
    """Working means that the vehicle's heartbeat comes; without one for LOST_S seconds it is away."""

    def __init__(self, unit: Unit) -> None:
        self._unit = unit
        check_link(unit["link"])
        self._us = (unit["system_id"], dialect.MAV_COMP_ID_MISSIONPLANNER)
        key = _key(unit["signing_key_file"])
        self._codec = Codec(
            system=self._us[0], component=self._us[1], count=unit.count, key=key, wall_ns=unit.clock.wall_ns()
        )
        self._vehicle = Vehicle(unit)
        self._telemetry = Telemetry(unit)
        self._pilot = Pilot(unit, self._vehicle, self._send)
        self._wire: Wire | None = None
        self._heartbeat_s = self._streams_s = 0.0
        self._heard: set[int] = set()

    def open(self) -> None:
        """Open the link and wait for the vehicle's heartbeat."""
        unit, link = self._unit, self._unit["link"]
        self._codec.clear()
        self._telemetry.forget()
        self._pilot.forget()
        self._heartbeat_s = self._streams_s = 0.0
        self._wire = open_wire(unit, link, unit["baud"])
        until_s = unit.clock.monotonic_s() + LOST_S
        while not self._vehicle.connected:
            if unit.stopping:
                return
            if unit.clock.monotonic_s() > until_s:
                raise UnavailableError(f"no heartbeat of a vehicle on {link}")
            self._step()
        state, target = self._vehicle.state, self._vehicle.target
        assert target is not None
        unit.opened(f"{state.autopilot} {state.vehicle} {target[0]}.{target[1]} on {link}")

    def run(self) -> None:
        """Hear and say, until the vehicle is not heard any more."""
        unit = self._unit
        while not unit.stopping:
            self._step()
            self._pilot.work()
            self._ask_for_telemetry()
            if not self._vehicle.connected:
                raise UnavailableError(f"no heartbeat for {LOST_S:g} s")

    def close(self) -> None:
        """Let the vehicle stand still, close the link."""
        wire = self._wire
        if wire is not None:
            try:
                self._pilot.rest()
            except UnavailableError:
                pass  # it is gone: its autopilot stops by itself when velocities end
            finally:
                self._wire = None
                wire.close()
        self._pilot.forget()
        self._vehicle.lost()

    # -- the wire --------------------------------------------------------------------------------------------------

    def _step(self) -> None:
        wire, now_s = self._wire, self._unit.clock.monotonic_s()
        assert wire is not None
        if now_s >= self._heartbeat_s:
            self._heartbeat_s = now_s + HEARTBEAT_S
            self._send(
                dialect.MAVLink_heartbeat_message(
                    dialect.MAV_TYPE_GCS, dialect.MAV_AUTOPILOT_INVALID, 0, 0, dialect.MAV_STATE_ACTIVE, 3
                )
            )
        for message in self._codec.feed(wire.read()):
            if self._vehicle.is_from(message):
                self._take(wire, message)

    def _take(self, wire: Wire, message: Any) -> None:
        kind = message.get_type()
        self._heard.add(message.get_msgId())
        if kind == "HEARTBEAT":
            wire.adopt()
            self._vehicle.on_heartbeat(message)
        elif kind == "COMMAND_ACK":
            self._pilot.asking.answer(message, self._us)
        else:
            self._telemetry.take(message)

    def _send(self, message: Any) -> None:
        wire = self._wire
        if wire is None:
            raise UnavailableError("the link is closed")
        wire.write(self._codec.pack(message))

    def _ask_for_telemetry(self) -> None:
        now_s, rate, target = self._unit.clock.monotonic_s(), self._unit["rate"], self._vehicle.target
        if now_s < self._streams_s or rate <= 0 or target is None:
            return
        asked_before, self._streams_s = self._streams_s > 0, now_s + ASK_AGAIN_S
        heard, self._heard = self._heard, set()
        for message_id, share in STREAMS.items():
            if not (asked_before and message_id in heard):
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
