"""What a ready gateway announces: a line, a status file, and its address for this user's command line."""

from __future__ import annotations

import contextlib
import json
import logging
import os
from dataclasses import dataclass
from pathlib import Path

from gateway.domain.host_names import url_of
from gateway.identity.local_key import LOCAL_KEY_FILE
from gateway.server.tls import ROOT_FILE
from gateway.settings import DEFAULT_GRPC_PORT, DEFAULT_HTTP_PORT, Settings
from gateway.store.engine import shown
from metaros.access.credentials import forget_key, save_key
from metaros.errors import ConfigError

__all__ = ["LocalAccess", "Ready", "ready_line", "write_status"]

log = logging.getLogger(__name__)


@dataclass(frozen=True, slots=True)
class Ready:
    """Where a running gateway listens."""

    host: str
    http_port: int
    grpc_port: int
    data_dir: Path
    tls: bool = False
    public_host: str = ""  # by which other machines reach it; "": none can
    roots_pem: str = ""  # under which its own certificate is; "": no TLS
    api_grpc_port: int = 0  # of people's programs
    foxglove_port: int = 0  # 0: it has none of its own
    rosbridge_port: int = 0

    @property
    def url(self) -> str:
        """The dashboard's address, as this machine reaches it."""
        wild = {"0.0.0.0": "127.0.0.1", "::": "::1"}
        return url_of(self._scheme, wild.get(self.host, self.host), self.http_port)

    @property
    def public_url(self) -> str:
        """Its address for other machines; "" where they cannot reach it."""
        return url_of(self._scheme, self.public_host, self.http_port) if self.public_host else ""

    @property
    def foxglove_url(self) -> str:
        """Where Foxglove connects: its own port, or the path on the main one."""
        url = url_of("wss" if self.tls else "ws", self._here, self.foxglove_port or self.http_port)
        return url if self.foxglove_port else f"{url}/foxglove"

    @property
    def _here(self) -> str:
        return self.public_host or {"0.0.0.0": "127.0.0.1", "::": "::1"}.get(self.host, self.host)

    @property
    def _scheme(self) -> str:
        return "https" if self.tls else "http"


def ready_line(settings: Settings, where: Ready) -> str:
    """Three lines: where people go, where programs and robots connect, and where the data is."""
    moved = [
        f"{what} {default} was taken"
        for what, asked, default, got in (
            ("port", settings.port, DEFAULT_HTTP_PORT, where.http_port),
            ("robots' port", settings.grpc_port, DEFAULT_GRPC_PORT, where.grpc_port),
        )
        if asked is None and got != default
    ]
    note = f" ({', '.join(moved)})" if moved else ""
    others = f" (others: {where.public_url})" if where.public_url not in ("", where.url) else ""
    store = f"  store {shown(settings.store_url)}" if settings.store_url else ""
    ports = f"robots {where.host}:{where.grpc_port}  programs {where.host}:{where.api_grpc_port}"
    for name, port in (("foxglove", where.foxglove_port), ("rosbridge", where.rosbridge_port)):
        ports += f"  {name} {where.host}:{port}" if port else ""
    return f"gateway ready: {where.url}{others}{note}\n  {ports}\n  data {where.data_dir}{store}"


def write_status(path: Path, where: Ready) -> None:
    """Write the status file in one step, so that a reader never sees half of it."""
    status = {
        "pid": os.getpid(),
        "ready": True,
        "host": where.host,
        "http_port": where.http_port,
        "grpc_port": where.grpc_port,
        "api_grpc_port": where.api_grpc_port,
        "foxglove_port": where.foxglove_port,
        "rosbridge_port": where.rosbridge_port,
        "url": where.url,
        "public_url": where.public_url,
        "data_dir": str(where.data_dir),
    }
    partial = path.with_name(path.name + ".partial")
    partial.write_text(json.dumps(status))
    partial.replace(path)


class LocalAccess:
    """While the gateway runs, this user's command line finds it, its key and its root in `~/.metaros/credentials`."""

    def __init__(self, data_dir: Path) -> None:
        self._key = (data_dir / LOCAL_KEY_FILE).resolve()
        self._url = ""

    def begin(self, where: Ready) -> None:
        """The gateway is ready."""
        root = (where.data_dir / ROOT_FILE).resolve() if where.tls else None
        try:
            save_key(where.url, self._key, ca=root)
            self._url = where.url
        except ConfigError as error:
            log.warning("the command line will not know this gateway: %s", error)

    def end(self) -> None:
        """The gateway is gone: whoever has its port next is not to be shown a key."""
        if self._url:
            with contextlib.suppress(ConfigError):
                forget_key(self._url, self._key)
