"""The gateway as a program: one event loop with uvicorn and grpc.aio, from ready to a clean end."""

from __future__ import annotations

import asyncio
import contextlib
import logging
import os
import socket
import sys
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import grpc
import uvicorn

from gateway.announce import LocalAccess, Ready, ready_line, write_status
from gateway.api.grpc.authenticate import Gate
from gateway.api.grpc.serving import add_fleet
from gateway.app import Gateway
from gateway.crowd import Crowd, Guest, open_files
from gateway.domain.networks import is_within, read_address
from gateway.grpc_server import ServerTls, make_server, tls_credentials
from gateway.http_server import protocols
from gateway.identity.door import Door
from gateway.ingest.link_service import add_links
from gateway.ports import listen
from gateway.settings import DEFAULT_API_GRPC_PORT, DEFAULT_GRPC_PORT, DEFAULT_HTTP_PORT, Settings
from gateway.tls import HttpTls, strict_transport
from gateway.tls_accept import TlsAcceptor
from metaros.clock import Clock, SystemClock
from metaros.errors import ConfigError
from metaros.inert import InertFormatter
from metaros.limits import LIMITS
from metaros.signals import on_stop

__all__ = ["Ready", "run", "serve"]

GRPC_GRACE_S = 0.5
HTTP_GRACE_S = 1


class _HttpServer(uvicorn.Server):
    """uvicorn without its signal handlers: the program has its own; `up` says when it serves."""

    def __init__(self, config: uvicorn.Config, *, crowd: Crowd, tls: HttpTls | None) -> None:
        super().__init__(config)
        self.up = asyncio.Event()
        self._crowd = crowd
        self._tls = tls
        self._accepting: asyncio.Task[None] | None = None

    @contextlib.contextmanager
    def capture_signals(self) -> Iterator[None]:
        """Leave signals alone."""
        yield

    async def startup(self, sockets: list[socket.socket] | None = None) -> None:
        """Start, then say so. Behind TLS the connections are accepted by us: see tls_accept.py."""
        tls = self._tls
        await super().startup(sockets if tls is None else [])
        if tls is not None and sockets:
            acceptor = TlsAcceptor(sockets[0], crowd=self._crowd, context=tls.context, protocol=self._protocol)
            self._accepting = asyncio.get_running_loop().create_task(acceptor.run())
        self.up.set()

    async def shutdown(self, sockets: list[socket.socket] | None = None) -> None:
        """Take nobody any more, then end as ever."""
        if self._accepting is not None:
            self._accepting.cancel()
        await super().shutdown(sockets)

    def _protocol(self, guest: Guest) -> asyncio.Protocol:
        made: Any = self.config.http_protocol_class
        state = {"server_state": self.server_state, "app_state": self.lifespan.state}
        protocol: asyncio.Protocol = made(config=self.config, **state, guest=guest)
        return protocol


async def serve(
    settings: Settings,
    stop: asyncio.Event,
    *,
    clock: Clock | None = None,
    door: Door | None = None,
    on_ready: Callable[[Ready], None] = lambda ready: None,
) -> None:
    """Run a gateway in this event loop until `stop` is set; `door` knows credentials beside its own."""
    listener = listen(settings.host, settings.port, default=DEFAULT_HTTP_PORT, flag="--port")
    try:
        gateway = Gateway(settings, clock=clock or SystemClock(), door=door)
    except BaseException:
        listener.close()
        raise
    try:
        await gateway.start()
        await _serve(gateway, listener, stop, on_ready)
    finally:
        listener.close()
        await gateway.stop()


async def _serve(
    gateway: Gateway, listener: socket.socket, stop: asyncio.Event, on_ready: Callable[[Ready], None]
) -> None:
    robots, gateway.grpc_port = _robots_server(gateway)
    programs, api_grpc_port = _programs_server(gateway)
    crowd = _crowd(gateway)
    http = _HttpServer(_http_config(gateway, crowd), crowd=crowd, tls=gateway.tls)
    await robots.start()
    await programs.start()
    try:
        async with asyncio.TaskGroup() as group:
            web = group.create_task(http.serve(sockets=[listener]))
            work = group.create_task(gateway.run())
            sweeping = group.create_task(crowd.run())
            starting = group.create_task(http.up.wait())
            await asyncio.wait({web, starting}, return_when=asyncio.FIRST_COMPLETED)
            on_ready(_ready(gateway, int(listener.getsockname()[1]), api_grpc_port))
            await stop.wait()
            gateway.links.close()
            await asyncio.gather(robots.stop(GRPC_GRACE_S), programs.stop(GRPC_GRACE_S))
            http.should_exit = True
            work.cancel()
            sweeping.cancel()
    finally:
        await asyncio.gather(robots.stop(0), programs.stop(0))
        crowd.close()


def _ready(gateway: Gateway, http_port: int, api_grpc_port: int) -> Ready:
    own = gateway.settings
    return Ready(
        own.host,
        http_port,
        gateway.grpc_port,
        own.data_dir,
        tls=own.tls_on,
        public_host=own.public_host,
        roots_pem=gateway.identities.authorities.roots_pem if own.tls_on else "",
        api_grpc_port=api_grpc_port,
    )


def _robots_server(gateway: Gateway) -> tuple[grpc.aio.Server, int]:
    """Where robots connect, and its port."""
    own = gateway.settings
    return _grpc_server(
        lambda server: add_links(server, gateway.links),
        host=own.host,
        port=own.grpc_port,
        default=DEFAULT_GRPC_PORT,
        flag="--grpc-port",
        connections=LIMITS.robots_connections,
        credentials=tls_credentials(lambda: _robots_tls(gateway)) if own.robots_tls else None,
    )


def _programs_server(gateway: Gateway) -> tuple[grpc.aio.Server, int]:
    """Where people's programs connect, and its port."""
    own, gate = gateway.settings, Gate(lambda: gateway.services)
    return _grpc_server(
        lambda server: add_fleet(server, gate),
        host=own.host,
        port=own.api_grpc_port,
        default=DEFAULT_API_GRPC_PORT,
        flag="--api-grpc-port",
        connections=LIMITS.programs_connections,
        credentials=tls_credentials(lambda: _programs_tls(gateway)) if own.robots_tls else None,
    )


def _grpc_server(
    add: Callable[[grpc.aio.Server], None],
    *,
    host: str,
    port: int | None,
    default: int,
    flag: str,
    connections: int,
    credentials: grpc.ServerCredentials | None,
) -> tuple[grpc.aio.Server, int]:
    """A server on a port that can be had; a default one that is taken moves to a free one.

    gRPC reports a taken port late and without its owner, so it is tried first; somebody may still be quicker.
    """
    with listen(host, port, default=default, flag=flag) as probe:
        free = int(probe.getsockname()[1])
    try:
        return make_server(add, host=host, port=free, connections=connections, credentials=credentials)
    except ConfigError:
        if port is not None:
            raise
        return make_server(add, host=host, port=0, connections=connections, credentials=credentials)


def _robots_tls(gateway: Gateway) -> ServerTls:
    """What the robots' port shows and asks for, now."""
    return ServerTls((_own_pair(gateway),), clients=gateway.identities.authorities.roots_pem.encode())


def _programs_tls(gateway: Gateway) -> ServerTls:
    """What the programs' port shows, now: as the HTTP port does."""
    return ServerTls(gateway.tls.pairs() if gateway.tls is not None else (_own_pair(gateway),))


def _own_pair(gateway: Gateway) -> tuple[bytes, bytes]:
    pair = gateway.identities.pair
    if pair is None:
        raise ConfigError("the gateway has no certificate for its gRPC ports")
    return pair.chain_pem, pair.key_pem


def _crowd(gateway: Gateway) -> Crowd:
    """Who may be connected to the HTTP port: of this machine and of proxies many."""
    proxies = gateway.settings.proxies

    def roomy(text: str) -> bool:
        address = read_address(text)
        return address is not None and (address.is_loopback or is_within(address, proxies))

    return Crowd(clock=gateway.clock, roomy=roomy, files=open_files())


def _http_config(gateway: Gateway, crowd: Crowd) -> uvicorn.Config:
    tls = gateway.tls
    http, socket_protocol = protocols(crowd, clock=gateway.clock)
    return uvicorn.Config(
        strict_transport(gateway.api, tls) if tls is not None else gateway.api,
        http=http,
        ws=socket_protocol,
        lifespan="off",
        log_config=None,
        access_log=False,
        server_header=False,
        proxy_headers=False,
        ws_max_size=LIMITS.frame_bytes,  # of the link; requests of the others are bounded where they are read
        ws_per_message_deflate=False,
        timeout_keep_alive=round(LIMITS.keep_alive_s),
        timeout_graceful_shutdown=HTTP_GRACE_S,
    )


def new_event_loop() -> asyncio.AbstractEventLoop:
    """uvloop's, which Windows does not have."""
    if sys.platform == "win32":
        return asyncio.new_event_loop()
    else:
        import uvloop

        return uvloop.new_event_loop()


def run(settings: Settings, *, status_file: Path | None = None) -> None:
    """Run until SIGINT or SIGTERM; prints where it listens."""
    os.umask(0o077)  # what a gateway keeps is for its own user
    handler = logging.StreamHandler()
    handler.setFormatter(InertFormatter("%(asctime)s %(levelname)s %(name)s: %(message)s"))
    logging.basicConfig(level=logging.WARNING, handlers=[handler])

    access = LocalAccess(settings.data_dir)

    def ready(where: Ready) -> None:
        print(ready_line(settings, where), flush=True)
        access.begin(where)
        if status_file is not None:
            write_status(status_file, where)

    async def main() -> None:
        stop = asyncio.Event()
        on_stop(asyncio.get_running_loop(), stop.set)
        await serve(settings, stop, on_ready=ready)

    with asyncio.Runner(loop_factory=new_event_loop) as runner:
        try:
            runner.run(main())
        finally:
            access.end()
    sys.stdout.flush()
