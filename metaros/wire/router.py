"""The Zenoh router that lets sessions find each other, and what already sits on its port.

A program that wants a router probes the port: `free` means host one, `zenoh` means join it, `foreign` means that
another program has the port and the router must move.
"""

from __future__ import annotations

import json
import os
import re
import socket
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Final, Literal

import zenoh

from metaros.errors import ConfigError
from metaros.wire.profile import make_profile
from metaros.wire.session import DEFAULT_PORT, QUEUE_BATCHES, insert_setting

__all__ = ["PortState", "Router", "open_router", "other_routers", "probe"]

PortState = Literal["free", "zenoh", "foreign"]
_SETTINGS: Final[Mapping[str, object]] = {
    "mode": "router",
    "scouting/multicast/enabled": False,
    "scouting/delay": 0,  # it scouts for nobody, so open need not wait half a second for answers
    "timestamping/enabled": True,
    "transport/link/tx/lease": 3000,
    "transport/link/tx/queue/size/data": QUEUE_BATCHES,
    "transport/link/tx/queue/size/data_low": QUEUE_BATCHES,
    "queries_default_timeout": 600_000,
}
_CONNECT_S: Final = 0.3
_ANSWER_S: Final = 1.5
_ROUTER: Final = re.compile(r"(?:tcp|tls)/(?P<host>[A-Za-z0-9._-]+|\[[0-9a-fA-F:.]+\]):(?P<port>[0-9]{1,5})")


class Router:
    """A running router; `endpoint` is where sessions connect to it."""

    def __init__(self, session: zenoh.Session, *, endpoint: str, port: int) -> None:
        self.session = session
        self.endpoint = endpoint
        self.port = port
        self.zid = str(session.info.zid())

    def links(self) -> int:
        """How many peers and routers are connected."""
        info = self.session.info
        return len(list(info.peers_zid())) + len(list(info.routers_zid()))

    def close(self) -> None:
        """Stop routing; peers notice at once."""
        if not self.session.is_closed():
            self.session.close()  # type: ignore[no-untyped-call]

    def __enter__(self) -> Router:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()


def open_router(
    port: int = DEFAULT_PORT,
    *,
    host: str = "127.0.0.1",
    environ: Mapping[str, str] | None = None,
    protected: Path | None = None,
    connect: Sequence[str] = (),
) -> Router:
    """Start a router in this process; ConfigError when the port is taken. `ZENOH_ROUTER_CONFIG_URI` is honoured.

    `protected` is the folder of the protected profile (`metaros.wire.profile`), made where it is missing. `connect` are
    other routers, which may come later and come back: it keeps trying.

    A router forwards what may block, so it keeps Zenoh's own larger thread pools: open it before any session.
    """
    environ = os.environ if environ is None else environ
    uri = environ.get("ZENOH_ROUTER_CONFIG_URI")
    endpoint = f"tcp/{host}:{port}"
    if protected is not None:
        uri = str(make_profile(protected, endpoint))
    try:
        config = zenoh.Config.from_file(uri.removeprefix("file://")) if uri else _default_config(endpoint)
        if connect:
            insert_setting(config, "connect/endpoints", json.dumps(list(connect)), "connect")
        session = zenoh.open(config)
    except zenoh.ZError as error:
        raise ConfigError(f"no router on {endpoint}: {error}") from None
    return Router(session, endpoint=endpoint, port=port)


def other_routers(endpoints: Sequence[str], *, own_host: str, port: int) -> list[str]:
    """Those of a list that are not this machine's own, so that all routers of a group can be given the same list.

    One is our own when its port is ours and its host, or the first part of that, is `own_host`.

    Raises:
        ConfigError: one is not like tcp/HOST:7447.
    """
    others = []
    for endpoint in endpoints:
        found = _ROUTER.fullmatch(endpoint)
        if found is None or not 0 < int(found["port"]) < 65536:
            raise ConfigError(f"--connect {endpoint[:80]}: a router is tcp/HOST:PORT, as tcp/far:{DEFAULT_PORT}")
        host = found["host"].lower()
        own = own_host.lower() in (host, host.partition(".")[0])
        if not (own and int(found["port"]) == port):
            others.append(endpoint)
    return others


def _default_config(endpoint: str) -> zenoh.Config:
    config = zenoh.Config()
    for key, value in _SETTINGS.items():
        insert_setting(config, key, json.dumps(value), "router setting")
    insert_setting(config, "listen/endpoints", json.dumps([endpoint]), "listen")
    return config


def probe(port: int, *, host: str = "127.0.0.1", answer_s: float = _ANSWER_S) -> PortState:
    """What is on `port`: nothing, something that speaks Zenoh and does so within `answer_s`, or another program."""
    try:
        with socket.create_connection((host, port), timeout=_CONNECT_S):
            pass
    except OSError:
        return "free" if _bindable(port, host) else "foreign"
    return "zenoh" if _speaks_zenoh(port, host, answer_s) else "foreign"


def _bindable(port: int, host: str) -> bool:
    with socket.socket() as listener:
        listener.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        try:
            listener.bind((host, port))
        except OSError:
            return False
    return True


def _speaks_zenoh(port: int, host: str, answer_s: float) -> bool:
    """Open a client session to it and close it again: a client cannot open without the handshake."""
    config = zenoh.Config()
    config.insert_json5("mode", '"client"')
    config.insert_json5("connect/endpoints", json.dumps([f"tcp/{host}:{port}"]))
    config.insert_json5("connect/timeout_ms", "0")  # once
    config.insert_json5("connect/exit_on_failure", "true")
    config.insert_json5("transport/unicast/open_timeout", str(round(answer_s * 1000)))
    config.insert_json5("scouting/multicast/enabled", "false")
    try:
        session = zenoh.open(config)
    except zenoh.ZError:
        return False
    session.close()  # type: ignore[no-untyped-call]
    return True
