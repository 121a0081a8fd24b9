"""The bus: python-can's, or a serial line that speaks slcan. Both give python-can's Messages."""

from __future__ import annotations

import contextlib
from typing import Any, Final

import can

from metaros.drivers.can import slcan
from metaros.drivers.context import DriverContext
from metaros.drivers.lines import LineSplitter
from metaros.drivers.serial_port import SerialPort
from metaros.errors import ConfigError, UnavailableError

__all__ = ["PythonCanBus", "SlcanBus", "open_bus"]

READ_S: Final = 0.05
_SEND_S: Final = 0.1


def open_bus(context: DriverContext) -> PythonCanBus | SlcanBus:
    """The bus of the parameters; UnavailableError where it is not there now."""
    return SlcanBus(context) if context["interface"] == "slcan" else PythonCanBus(context)


class PythonCanBus:
    """One of python-can's interfaces."""

    def __init__(self, context: DriverContext) -> None:
        self._context = context
        self.name = f"{context['interface']} {context['channel']}"
        options = (
            {} if context["interface"] in ("virtual", "udp_multicast", "socketcan") else {"bitrate": context["bitrate"]}
        )
        try:
            self._bus: Any = can.Bus(interface=context["interface"], channel=context["channel"], **options)
        except can.CanInterfaceNotImplementedError as error:
            raise ConfigError(f"can: {self.name}: {error}") from None
        except (can.CanError, OSError, ValueError) as error:
            raise UnavailableError(f"{self.name}: {error}") from None

    def read(self) -> list[Any]:
        """What came, READ_S waited for at most."""
        try:
            message = self._bus.recv(READ_S)
        except can.CanOperationError as error:
            if "unpack" in str(error):  # one datagram of a multicast bus that is no frame
                self._context.count("bad_frames")
                return []
            raise UnavailableError(f"{self.name}: {error}") from None
        except (OSError, ValueError) as error:
            raise UnavailableError(f"{self.name}: {error}") from None
        return [] if message is None else [message]

    def send(self, message: Any) -> None:
        """UnavailableError where the bus does not take it."""
        try:
            self._bus.send(message, timeout=_SEND_S)
        except (can.CanError, OSError) as error:
            raise UnavailableError(f"{self.name}: {error}") from None

    def close(self) -> None:
        """Leave the bus."""
        self._bus.shutdown()


class SlcanBus:
    """An adapter on a serial port."""

    def __init__(self, context: DriverContext) -> None:
        self._context = context
        self.name = f"slcan {context['channel']}"
        if context["bitrate"] not in slcan.BITRATES:
            raise ConfigError(f"can: slcan has the bitrates {', '.join(map(str, slcan.BITRATES))}")
        self._port = SerialPort(context, context["channel"], context["baud"])
        self._lines = LineSplitter(max_bytes=slcan.MAX_LINE, count=context.count)
        self._port.write(b"\r" + slcan.CLOSE + slcan.set_bitrate(context["bitrate"]) + slcan.OPEN)

    def read(self) -> list[Any]:
        """What came, a tenth of a second waited for at most."""
        data = self._port.read()
        if refusals := data.count(b"\a"):
            self._context.count("refused_by_adapter", refusals)
        found = []
        for line in self._lines.feed(data.replace(b"\a", b"\r")):
            frame = slcan.parse_frame(line)
            if frame is not None:
                found.append(can.Message(**frame))
            elif line not in ("z", "Z"):  # the answers to what we sent
                self._context.count("bad_frames")
        return found

    def send(self, message: Any) -> None:
        """Write the line; whether the adapter took it, it tells later."""
        self._port.write(
            slcan.format_frame(
                identifier=message.arbitration_id,
                extended=message.is_extended_id,
                remote=message.is_remote_frame,
                length=message.dlc,
                data=bytes(message.data),
            )
        )

    def close(self) -> None:
        """Close the channel and the port."""
        with contextlib.suppress(UnavailableError):
            self._port.write(slcan.CLOSE)
        self._port.close()
