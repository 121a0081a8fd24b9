"""One Zenoh session set up as rmw_zenoh sets up its own: a peer that finds others through the router.

Environment, under ROS's own names: `ROS_DOMAIN_ID`, `ZENOH_SESSION_CONFIG_URI` (a file), `ZENOH_CONFIG_OVERRIDE`
(`key=value;key=value`, JSON5 values), and ours: `METAROS_ZENOH_PORT`, `METAROS_SHARED_MEMORY`, `METAROS_ROS_DISTRO`.
What a program passes wins over the environment. Zenoh's threads are one receive and one send worker for the whole
process, unless `ZENOH_RUNTIME` says otherwise.
"""

from __future__ import annotations

import atexit
import itertools
import json
import os
import threading
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from typing import Final

import zenoh

from metaros.concurrency.waiting import pause
from metaros.errors import ClosedError, ConfigError, NameError_
from metaros.wire.allocator import keep_large_blocks
from metaros.wire.distribution import writes_hashes
from metaros.wire.keys import parse_domain
from metaros.wire.shm import shared_pool

__all__ = [
    "QUEUE_BATCHES",
    "RUNTIME_THREADS",
    "WireSession",
    "default_endpoint",
    "domain_from",
    "session_config",
]

DEFAULT_PORT: Final = 7447
RUNTIME_THREADS: Final = (
    "(rx: (worker_threads: 1), acc: (handover: rx), app: (handover: rx), tx: (worker_threads: 1), net: (handover: tx))"
)
# Of 64 KiB each. With Zenoh's own 2 a message of 1 MiB, which is 17, passes the thread that sends pair by pair.
QUEUE_BATCHES: Final = 16
_LINK_WAIT_S: Final = 0.5  # what Zenoh itself would wait in open(); a session that finds nothing goes on alone
_SETTINGS: Final[Mapping[str, object]] = {
    "mode": "peer",
    "scouting/multicast/enabled": False,
    "scouting/gossip/enabled": True,
    "scouting/gossip/target": {"router": ["router", "peer"], "peer": ["router"]},
    "scouting/gossip/autoconnect": {"router": [], "peer": ["router", "peer"]},
    "scouting/gossip/autoconnect_strategy": {"peer": {"to_router": "always", "to_peer": "greater-zid"}},
    "connect/timeout_ms": {"router": -1, "peer": -1, "client": 0},
    "connect/exit_on_failure": {"router": False, "peer": False, "client": True},
    "connect/retry": {"period_init_ms": 200, "period_max_ms": 1000, "period_increase_factor": 2},
    "open/return_conditions/connect_scouted": False,  # it would cost every open half a second: we wait for a link
    "timestamping/enabled": True,  # caches of transient_local publishers need stamped samples
    "queries_default_timeout": 600_000,
    "transport/link/tx/lease": 3000,  # so that a hung process leaves the graph in seconds, not a minute
    "transport/link/tx/queue/size/data": QUEUE_BATCHES,
    "transport/link/tx/queue/size/data_low": QUEUE_BATCHES,
    "transport/shared_memory/enabled": False,
}
_SHARED_MEMORY: Final[Mapping[str, object]] = {
    "transport/shared_memory/enabled": True,
    "transport/shared_memory/transport_optimization/enabled": False,  # our own pool counts what it has no room for
}


def domain_from(environ: Mapping[str, str]) -> int:
    """The domain that `ROS_DOMAIN_ID` names, else 0."""
    text = environ.get("ROS_DOMAIN_ID") or "0"
    try:
        return parse_domain(text)
    except NameError_ as error:
        raise ConfigError(f"ROS_DOMAIN_ID: {error}") from None


def default_endpoint(environ: Mapping[str, str]) -> str:
    """Where the router of this host listens: port `METAROS_ZENOH_PORT`, else 7447."""
    text = environ.get("METAROS_ZENOH_PORT") or str(DEFAULT_PORT)
    if not (text.isascii() and text.isdigit() and 0 < int(text) < 65536):
        raise ConfigError(f"METAROS_ZENOH_PORT: {text!r} is no port within 1..65535")
    return f"tcp/localhost:{text}"


def session_config(
    environ: Mapping[str, str],
    *,
    connect: Sequence[str] | None = None,
    listen: Sequence[str] | None = None,
    shared_memory: bool = False,
    client: bool = False,
) -> zenoh.Config:
    """The configuration of a session; ConfigError names the setting that Zenoh refuses."""
    uri = environ.get("ZENOH_SESSION_CONFIG_URI")
    if uri:
        config = _config_file(uri)
    else:
        config = zenoh.Config()
        for key, value in _SETTINGS.items():
            insert_setting(config, key, json.dumps(value), "session setting")
        insert_setting(config, "connect/endpoints", json.dumps([default_endpoint(environ)]), "connect")
        insert_setting(config, "listen/endpoints", json.dumps(["tcp/localhost:0"]), "listen")
    if shared_memory:
        for key, value in _SHARED_MEMORY.items():
            insert_setting(config, key, json.dumps(value), "shared_memory")
    for key, text in _overrides(environ.get("ZENOH_CONFIG_OVERRIDE", "")):
        insert_setting(config, key, text, "ZENOH_CONFIG_OVERRIDE")
    if connect is not None:
        insert_setting(config, "connect/endpoints", json.dumps(list(connect)), "connect")
    if listen is not None:
        insert_setting(config, "listen/endpoints", json.dumps(list(listen)), "listen")
    if client:
        insert_setting(config, "mode", '"client"', "mode")
    return config


def insert_setting(config: zenoh.Config, key: str, text: str, source: str) -> None:
    """Put one JSON5 value in; ConfigError where Zenoh does not take it."""
    try:
        config.insert_json5(key, text)
    except zenoh.ZError as error:
        raise ConfigError(f"{source}: {key}={text}: {error}") from None


def _config_file(uri: str) -> zenoh.Config:
    from pathlib import Path  # few programs have such a file, and all would wait for these modules
    from urllib.parse import unquote, urlsplit

    path = Path(unquote(urlsplit(uri).path) if uri.startswith("file:") else uri)
    try:
        return zenoh.Config.from_file(path)
    except zenoh.ZError as error:
        raise ConfigError(f"ZENOH_SESSION_CONFIG_URI: {path}: {error}") from None


def _overrides(text: str) -> Iterator[tuple[str, str]]:
    for item in filter(None, (part.strip() for part in text.split(";"))):
        key, equals, value = item.partition("=")
        if not equals:
            raise ConfigError(f"ZENOH_CONFIG_OVERRIDE: {item!r} is not key=value")
        yield key.strip(), value.strip()


@contextmanager
def _runtime_threads() -> Iterator[None]:
    """Zenoh reads ZENOH_RUNTIME at a process's first open; ours must not leak to child processes (routers)."""
    if "ZENOH_RUNTIME" in os.environ:
        yield
        return
    os.environ["ZENOH_RUNTIME"] = RUNTIME_THREADS
    try:
        yield
    finally:
        os.environ.pop("ZENOH_RUNTIME", None)


class WireSession:
    """An open session in one domain, with the entity counter that its tokens share. Thread-safe."""

    def __init__(
        self,
        *,
        domain_id: int | None = None,
        connect: str | Sequence[str] | None = None,
        listen: str | Sequence[str] | None = None,
        environ: Mapping[str, str] | None = None,
        shared_memory: str | None = None,
        ros_distro: str | None = None,
    ) -> None:
        environ = os.environ if environ is None else environ
        self._environ = environ
        self.domain = parse_domain(str(domain_id)) if domain_id is not None else domain_from(environ)
        self.writes_hashes = writes_hashes(ros_distro, environ)
        keep_large_blocks(environ)
        self.shared_pool = shared_pool(shared_memory, environ)
        config = session_config(
            environ,
            connect=_endpoints(connect),
            listen=_endpoints(listen),
            shared_memory=self.shared_pool is not None,
        )
        self.connect: list[str] = _listed(config.get_json("connect/endpoints"))
        try:
            with _runtime_threads():
                self.zenoh = zenoh.open(config)
        except zenoh.ZError as error:
            raise ConfigError(f"no Zenoh session: {error}") from None
        self.zid = str(self.zenoh.info.zid())
        self._ids = itertools.count()
        self._closed = False
        self._close_lock = threading.Lock()
        atexit.register(self.close)
        if self.connect:
            self.wait_linked(_LINK_WAIT_S)

    def next_id(self) -> int:
        """A number for the next node or endpoint: one counter for both, from 0."""
        return next(self._ids)

    def connected(self) -> bool:
        """Whether a router or a peer is linked now."""
        if self._closed:
            return False
        info = self.zenoh.info
        return bool(info.routers_zid() or info.peers_zid())

    def wait_linked(self, timeout_s: float) -> bool:
        """Wait until a router or a peer is linked; False when none is after `timeout_s`."""
        for _ in range(max(1, round(timeout_s / 0.002))):
            if self.connected():
                return True
            pause(0.002)
        return self.connected()

    @property
    def closed(self) -> bool:
        """Whether `close` was called."""
        return self._closed

    @contextmanager
    def client(self) -> Iterator[zenoh.Session]:
        """One more session, a client of the same routers: they answer it in full, where a peer is told bit by bit.

        Raises:
            zenoh.ZError: there is no router.
        """
        config = session_config(self._environ, connect=self.connect, listen=(), client=True)
        with zenoh.open(config) as opened:
            yield opened

    def check_open(self) -> zenoh.Session:
        """The Zenoh session; ClosedError after `close`."""
        if self._closed:
            raise ClosedError("the session was closed")
        return self.zenoh

    def close(self) -> None:
        """Leave the network; every declaration goes with the session. Safe to call twice, and at exit."""
        with self._close_lock:
            if self._closed:
                return
            self._closed = True
        atexit.unregister(self.close)
        with suppress(zenoh.ZError):
            self.zenoh.close()  # type: ignore[no-untyped-call]
        if self.shared_pool is not None:
            self.shared_pool.close()


def _endpoints(given: str | Sequence[str] | None) -> Sequence[str] | None:
    return [given] if isinstance(given, str) else given


def _listed(value: object) -> list[str]:
    """Endpoints as Zenoh's configuration gives them back: a list, or one list a mode, as JSON text or parsed."""
    if isinstance(value, str):
        value = json.loads(value)
    if isinstance(value, Mapping):
        value = value.get("peer", [])
    return [str(item) for item in value] if isinstance(value, list) else []
