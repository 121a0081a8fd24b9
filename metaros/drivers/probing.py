"""What a probe finds: devices of this machine that a driver could run."""

from __future__ import annotations

import shlex
from collections.abc import Mapping
from dataclasses import dataclass, field

__all__ = ["Found", "serial_ports"]


@dataclass(frozen=True, slots=True, kw_only=True)
class Found:
    """A device. `certain`: it answered or names itself; otherwise it merely could be one."""

    kind: str
    summary: str
    parameters: Mapping[str, str] = field(default_factory=dict)
    certain: bool = False

    @property
    def command(self) -> str:
        """What starts its driver."""
        given = "".join(f" --param {shlex.quote(f'{name}={value}')}" for name, value in self.parameters.items())
        return f"metaros driver run {self.kind}{given}"


def serial_ports() -> list[tuple[str, str, int, int]]:
    """This machine's serial ports: device, description, USB vendor and product (0 where it is none)."""
    from serial.tools import list_ports

    return sorted((port.device, port.description or "", port.vid or 0, port.pid or 0) for port in list_ports.comports())
