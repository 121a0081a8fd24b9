"""What a probe finds: devices of this machine that a driver could run."""

from __future__ import annotations

import shlex
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field

from metaros.drivers.manifest import Manifest

__all__ = ["Found", "probe", "serial_ports"]


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


def probe(manifests: Sequence[Manifest]) -> Iterator[tuple[Manifest, Sequence[Found]]]:
    """Look for devices of these kinds, one kind after the other; a kind without a probe finds nothing.

    Probes only look (lists of devices, USB ids): none sends bytes to a device that it does not know.
    """
    from metaros.drivers.registry import prober

    for manifest in manifests:
        find = prober(manifest.kind)
        yield manifest, tuple(find()) if find is not None else ()


def serial_ports() -> list[tuple[str, str, int, int]]:
    """This machine's serial ports: device, description, USB vendor and product (0 where it is none)."""
    from serial.tools import list_ports

    return sorted((port.device, port.description or "", port.vid or 0, port.pid or 0) for port in list_ports.comports())
