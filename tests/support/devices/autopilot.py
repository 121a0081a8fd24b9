"""A vehicle for tests: it speaks MAVLink by pymavlink's own codec over real UDP, TCP or a pty, as its script says."""

from __future__ import annotations

import contextlib
import select
import socket
import threading
from types import TracebackType
from typing import Any

from pymavlink.dialects.v20 import ardupilotmega as dialect

from tests.support.devices.pty_device import PtyDevice

__all__ = ["Autopilot", "PtyCable", "TcpCable", "UdpCable"]

PERIOD_S = 0.02


class UdpCable:
    """The vehicle sends to an address, and hears what comes back."""

    def __init__(self, port: int) -> None:
        self._socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self._socket.setblocking(False)
        self._there = ("127.0.0.1", port)

    def write(self, data: bytes) -> None:
        with contextlib.suppress(OSError):
            self._socket.sendto(data, self._there)

    def read(self) -> bytes:
        if not select.select([self._socket], [], [], PERIOD_S / 2)[0]:
            return b""
        try:
            return self._socket.recv(65535)
        except ConnectionError:
            return b""

    def close(self) -> None:
        self._socket.close()


class TcpCable:
    """The vehicle listens; one client at a time."""

    def __init__(self, port: int) -> None:
        self._listener = socket.create_server(("127.0.0.1", port))
        self._client: socket.socket | None = None

    def write(self, data: bytes) -> None:
        if self._client is not None:
            try:
                self._client.sendall(data)
            except OSError:
                self._hang_up()

    def read(self) -> bytes:
        waits_for = self._client or self._listener
        if not select.select([waits_for], [], [], PERIOD_S / 2)[0]:
            return b""
        if self._client is None:
            self._client = self._listener.accept()[0]
            return b""
        try:
            data = self._client.recv(65535)
        except OSError:
            data = b""
        if not data:
            self._hang_up()
        return data

    def close(self) -> None:
        self._hang_up()
        self._listener.close()

    def _hang_up(self) -> None:
        if self._client is not None:
            self._client.close()
        self._client = None


class PtyCable:
    """A serial line."""

    def __init__(self, pty: PtyDevice) -> None:
        self._pty = pty

    def write(self, data: bytes) -> None:
        self._pty.write(data)

    def read(self) -> bytes:
        return self._pty.read(PERIOD_S / 2)

    def close(self) -> None:
        pass


class Autopilot:
    """Heartbeats every PERIOD_S from its making, until `close`. Its public fields are the script."""

    def __init__(
        self,
        cable: Any,
        *,
        system: int = 1,
        component: int = 1,
        vehicle: int = dialect.MAV_TYPE_QUADROTOR,
        autopilot: int = dialect.MAV_AUTOPILOT_ARDUPILOTMEGA,
        key: bytes = b"",
        timestamp: int = 0,
    ) -> None:
        self.vehicle, self.autopilot = vehicle, autopilot
        self.mode, self.armed = 0, False
        self.silent = False  # as if its link were cut
        self.deaf_to = 0  # so many commands are lost on the way
        self.refuses = 0  # the MAV_RESULT of its answers
        self.received: list[Any] = []
        self.received_all = False  # nothing more is on its way to it
        self._cable = cable
        self._mav = dialect.MAVLink(self, srcSystem=system, srcComponent=component)
        self._ears = dialect.MAVLink(None)
        self._ears.robust_parsing = True
        if key:
            self._mav.signing.secret_key, self._mav.signing.sign_outgoing = key, True
            self._mav.signing.timestamp = timestamp
        self._lock = threading.Lock()
        self._stop = threading.Event()
        self._thread = threading.Thread(target=self._live, name="autopilot")
        self._thread.start()

    def of_type(self, name: str) -> list[Any]:
        """What the driver sent of that type."""
        return [message for message in list(self.received) if message.get_type() == name]

    def commands(self, number: int) -> list[Any]:
        """The COMMAND_LONGs with that number."""
        return [message for message in self.of_type("COMMAND_LONG") if message.command == number]

    def send(self, message: Any) -> None:
        """Send one message, unless it is silent."""
        with self._lock:
            if not self.silent:
                self._mav.send(message)

    def write(self, data: bytes) -> None:
        """Raw bytes, such as garbage; pymavlink sends by this too."""
        self._cable.write(bytes(data))

    def close(self) -> None:
        """It is switched off."""
        self._stop.set()
        self._thread.join(60)
        assert not self._thread.is_alive()
        self._cable.close()

    def __enter__(self) -> Autopilot:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()

    def _live(self) -> None:
        while not self._stop.wait(PERIOD_S / 2):
            base = dialect.MAV_MODE_FLAG_CUSTOM_MODE_ENABLED
            base |= dialect.MAV_MODE_FLAG_SAFETY_ARMED if self.armed else 0
            state = dialect.MAV_STATE_ACTIVE if self.armed else dialect.MAV_STATE_STANDBY
            self.send(dialect.MAVLink_heartbeat_message(self.vehicle, self.autopilot, base, self.mode, state, 3))
            data = self._cable.read()
            self.received_all = not data
            for message in self._ears.parse_buffer(data) or []:
                if not self.silent:
                    self.received.append(message)
                    self._obey(message)

    def _obey(self, message: Any) -> None:
        if message.get_type() != "COMMAND_LONG":
            return
        known = (dialect.MAV_CMD_COMPONENT_ARM_DISARM, dialect.MAV_CMD_DO_SET_MODE)
        if message.command in known:
            if self.deaf_to > 0:
                self.deaf_to -= 1
                return
            if self.refuses == 0 and message.command == dialect.MAV_CMD_COMPONENT_ARM_DISARM:
                self.armed = message.param1 == 1
            elif self.refuses == 0:
                self.mode = int(message.param2)
        result = self.refuses if message.command in known else 0
        answer = dialect.MAVLink_command_ack_message(
            message.command, result, 0, 0, message.get_srcSystem(), message.get_srcComponent()
        )
        self.send(answer)
