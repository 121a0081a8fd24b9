"""Where a gateway is, one text of the settings, and how it is talked to."""

from __future__ import annotations

import re
from dataclasses import dataclass, replace
from typing import Final, Literal
from urllib.parse import urlsplit

from metaros.errors import ConfigError

__all__ = ["Compression", "GatewayAddress", "TransportName", "TransportSetting", "parse_address"]

Compression = Literal["none", "zstd"]
TransportName = Literal["grpc", "websocket"]
TransportSetting = Literal["auto", "grpc", "websocket"]

BOTH: Final = ("grpc", "websocket")
FORMS = "HOST:PORT, grpc[s]://HOST[:PORT] or http[s]://HOST[:PORT]"
LINK_PATH = "/api/v1/link"
PORTS = {"http": 80, "https": 443, "grpc": 8081, "grpcs": 8081}
GRPC_ALONE = ("grpc", "grpcs")

_HOST_PORT = re.compile(r"(\[[0-9A-Fa-f:.]+\]|[^\s/:@\[\]]+):[0-9]{1,5}")
_PATH = re.compile(r"(/[A-Za-z0-9._~-]+)*")


@dataclass(frozen=True, slots=True)
class GatewayAddress:
    """A host and port with what may be spoken there, the first choice first."""

    text: str  # as people wrote it
    host: str
    port: int
    tls: bool = False
    path: str = ""  # before /api/v1/link, for a proxy that serves several things
    transports: tuple[TransportName, ...] = BOTH

    @property
    def authority(self) -> str:
        """HOST:PORT."""
        return f"[{self.host}]:{self.port}" if ":" in self.host else f"{self.host}:{self.port}"

    @property
    def link_url(self) -> str:
        """Where its WebSocket is."""
        return f"{'wss' if self.tls else 'ws'}://{self.authority}{self.path}{LINK_PATH}"

    def only(self, setting: TransportSetting) -> GatewayAddress:
        """The same place with no other transport than that. Raises ConfigError."""
        if setting == "auto":
            return self
        if setting not in self.transports:
            raise ConfigError(f"gateway {self.text!r} cannot be reached by transport {setting!r}")
        return replace(self, transports=(setting,))


def parse_address(text: str) -> GatewayAddress:
    """Read one gateway's address.

    HOST:PORT and http(s):// mean: gRPC on that port, else a WebSocket on the same port. grpc(s):// means gRPC alone.
    With a path there is only the WebSocket, as gRPC has no place for one. Raises ConfigError.
    """
    scheme, split, _rest = text.partition("://")
    if not split and not _HOST_PORT.fullmatch(text):
        raise ConfigError(f"gateway must be {FORMS}, not {text!r}")
    try:
        url = urlsplit(text if split else f"http://{text}")
        port = url.port if url.port is not None else PORTS.get(url.scheme, 0)
    except ValueError as error:
        raise ConfigError(f"gateway {text!r}: {error}") from error
    path = url.path.rstrip("/")
    if url.scheme not in PORTS or not url.hostname or not 1 <= port <= 65535:
        raise ConfigError(f"gateway must be {FORMS}, not {text!r}")
    if "@" in url.netloc or url.query or url.fragment or not _PATH.fullmatch(path) or (path and scheme in GRPC_ALONE):
        raise ConfigError(
            f"gateway {text!r}: an address has no user, query or odd path, and grpc(s):// has no path at all"
        )
    transports: tuple[TransportName, ...] = ("grpc",) if url.scheme in GRPC_ALONE else ("websocket",) if path else BOTH
    return GatewayAddress(text, url.hostname, port, url.scheme in ("https", "grpcs"), path, transports)
