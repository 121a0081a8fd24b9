"""The connection to an RPLIDAR: information, health, motor, scan; tolerant of garbage and late answers."""

from __future__ import annotations

import struct
from typing import Final

from metaros.drivers.context import DriverContext
from metaros.drivers.rplidar.protocol import (
    EXPRESS_SCAN,
    GET_HEALTH,
    GET_INFO,
    RESET,
    SCAN,
    SET_PWM,
    STOP,
    Descriptor,
    Health,
    Info,
    request,
    take_descriptor,
)
from metaros.drivers.rplidar.samples import EXPRESS, STANDARD, CapsuleStream, NodeStream, SampleStream
from metaros.drivers.serial_port import SerialPort
from metaros.errors import UnavailableError

__all__ = ["RplidarConnection"]

ANSWER_S: Final = 1.0
TRIES: Final = 3
QUIET_S: Final = 0.02  # the protocol asks for 1 ms after a stop; what is on its way comes meanwhile
REBOOT_S: Final = 1.0
PWM: Final = 660  # the maker's usual speed, of 1023


class RplidarConnection:
    """One opened port. What it cannot find out is an UnavailableError that says what was missing."""

    def __init__(self, context: DriverContext, port: SerialPort) -> None:
        self._context = context
        self._port = port
        self.rest = b""  # what came behind the last descriptor

    def stop_scan(self) -> None:
        """Stop whatever the device was doing."""
        self._port.write(request(STOP))
        self._context.wait(QUIET_S)
        self._port.discard()

    def info(self) -> Info:
        """Which device it is."""
        return Info.parse(self._answer(GET_INFO, Info.DESCRIPTOR, "who it is"))

    def check_health(self) -> Health:
        """How it is; one that is in error is reset once. UnavailableError where that does not help."""
        health = self._health()
        if health.word == "error":
            self._context.count("resets")
            self._context.warn(f"its health is bad (code {health.code}): reset")
            self._port.write(request(RESET))
            self._context.wait(REBOOT_S)
            self._port.discard()
            health = self._health()
        if health.word == "error":
            raise UnavailableError(f"{self._port.port}: its health is bad (code {health.code}), also after a reset")
        return health

    def turn_motor(self, how: str, info: Info) -> None:
        """`dtr`: by the adapter's line; `pwm`: by a command; `auto`: both where the model needs them; `none`."""
        if how in ("auto", "dtr"):
            self._port.set_dtr(False)  # A1's adapter: low turns it
        if how == "pwm" or (how == "auto" and info.needs_pwm):
            self._port.write(request(SET_PWM, struct.pack("<H", PWM)))

    def rest_motor(self, how: str) -> None:
        """Stop scanning and, where we turned it on, the motor."""
        self._port.write(request(STOP))
        if how == "pwm":
            self._port.write(request(SET_PWM, struct.pack("<H", 0)))
        if how in ("auto", "dtr"):
            self._port.set_dtr(True)

    def scan(self, mode: str, info: Info) -> tuple[str, SampleStream]:
        """Begin; says in which mode, and what reads it. `auto`: express where the device answers to it."""
        if mode == "express" or (mode == "auto" and info.has_express):
            if self._begins(request(EXPRESS_SCAN, bytes(5)), EXPRESS):
                return "express", CapsuleStream()
            if mode == "express":
                raise UnavailableError(f"{self._port.port}: {info.name} does not answer to express scans")
            self.stop_scan()
        if not self._begins(request(SCAN), STANDARD):
            raise UnavailableError(f"{self._port.port}: {info.name} does not begin to scan")
        return "standard", NodeStream()

    def _health(self) -> Health:
        return Health.parse(self._answer(GET_HEALTH, Health.DESCRIPTOR, "how it is"))

    def _begins(self, order: bytes, wanted: Descriptor) -> bool:
        self._port.write(order)
        kept = bytearray()
        if not self._await(kept, wanted):
            return False
        self.rest = bytes(kept)
        return True

    def _answer(self, command: int, wanted: Descriptor, what: str) -> bytes:
        for attempt in range(TRIES):
            if attempt:
                self._context.count("asked_again")
                self.stop_scan()
            self._port.write(request(command))
            kept = bytearray()
            if self._await(kept, wanted) and self._fill(kept, wanted.size_bytes):
                return bytes(kept[: wanted.size_bytes])
        raise UnavailableError(f"{self._port.port}: no RPLIDAR answers here (asked {TRIES} times {what})")

    def _await(self, kept: bytearray, wanted: Descriptor) -> bool:
        """Read on to the wanted descriptor; others, and garbage, are passed over."""
        until_s, late = self._context.clock.monotonic_s() + ANSWER_S, False
        while not self._context.stopping:
            while (found := take_descriptor(kept)) is not None:
                if found == wanted:
                    return True
                self._context.count("wrong_answers")
            if late:
                return False
            # One more reading after the deadline: where it was this process that slept, the answer is there.
            late = self._context.clock.monotonic_s() > until_s
            kept += self._port.read()
        return False

    def _fill(self, kept: bytearray, size_bytes: int) -> bool:
        until_s, late = self._context.clock.monotonic_s() + ANSWER_S, False
        while len(kept) < size_bytes and not late and not self._context.stopping:
            late = self._context.clock.monotonic_s() > until_s
            kept += self._port.read()
        return len(kept) >= size_bytes
