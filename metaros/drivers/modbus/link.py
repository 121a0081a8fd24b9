"""Where a device is: `tcp://HOST:502`, or `serial:///dev/ttyUSB0?baud=9600&parity=E&stop=1`. Pure."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final
from urllib.parse import parse_qsl, unquote, urlsplit

from metaros.errors import ConfigError

__all__ = ["Link", "read_link"]

_EXAMPLE: Final = "such as tcp://10.0.0.5:502 or serial:///dev/ttyUSB0?baud=9600&parity=E"


@dataclass(frozen=True, slots=True, kw_only=True)
class Link:
    """TCP where there is a `host`, else a serial line."""

    name: str
    host: str = ""
    port: int = 502
    device: str = ""
    baud: int = 9600
    parity: str = "N"
    stop_bits: int = 1


def read_link(text: str) -> Link:
    """ConfigError where it is none."""
    try:
        parts = urlsplit(text)
        given = dict(parse_qsl(parts.query, strict_parsing=bool(parts.query)))
        if parts.scheme == "tcp" and parts.hostname and not given and parts.path in ("", "/"):
            return Link(name=text, host=parts.hostname, port=parts.port or 502)
        if parts.scheme == "serial" and set(given) <= {"baud", "parity", "stop"}:
            device = unquote(parts.netloc + parts.path)
            baud, parity, stop = int(given.get("baud", 9600)), given.get("parity", "N"), int(given.get("stop", 1))
            if device and 300 <= baud <= 4_000_000 and parity in ("N", "E", "O") and stop in (1, 2):
                return Link(name=device, device=device, baud=baud, parity=parity, stop_bits=stop)
    except ValueError:
        pass
    raise ConfigError(f"modbus: link {text!r} is none; {_EXAMPLE}")
