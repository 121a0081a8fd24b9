"""The gateway as a program: one event loop with uvicorn and grpc.aio, from ready to a clean end."""

from __future__ import annotations

import asyncio
import contextlib
import logging
import math
import os
import socket
import sys
from collections.abc import Callable, Iterator
from functools import cache, partial
from pathlib import Path
from typing import Any

import grpc
import uvicorn

from gateway.api.grpc.authenticate import CallAuthorizer
from gateway.api.grpc.serving import add_programs
from gateway.api.viewer_endpoints import FOXGLOVE, ROSBRIDGE, ProtocolPorts
from gateway.app import create_app, services_of
from gateway.domain.networks import is_within, read_address
from gateway.drain import drain
from gateway.identity.authenticator import Authenticator
from gateway.identity.passwords import Passwords
from gateway.ingest.link_service import add_links
from gateway.ops.logs import set_up_logs
from gateway.server.announce import LocalAccess, Ready, ready_line, write_status
from gateway.server.connections import Connection, ConnectionLimits, open_files
from gateway.server.garbage_collector import tune_garbage_collector
from gateway.server.grpc import ServerTls, make_server
from gateway.server.http import protocols
from gateway.server.ports import Listeners, PortChoice, listen, listen_all, port_of
from gateway.server.systemd import ENDING, READY, notify_systemd, watchdog_loop
from gateway.server.tls import HttpTls, strict_transport
from gateway.server.tls_accept import TlsAcceptor
from gateway.settings import (
    DEFAULT_API_GRPC_PORT,
    DEFAULT_FOXGLOVE_PORT,
    DEFAULT_GRPC_PORT,
    DEFAULT_HTTP_PORT,
    DEFAULT_ROSBRIDGE_PORT,
    Settings,
)
from gateway.wiring.gateway import Gateway
from metaros.clock import Clock, SystemClock
from metaros.concurrency.signals import on_stop
from metaros.errors import ConfigError
from metaros.executor.switch_interval import SWITCH_INTERVAL_S, shorten_switch_interval
from metaros.limits import LIMITS

__all__ = ["Ready", "run", "serve"]

log = logging.getLogger(__name__)

DATE_S = 1.0  # how long an answer's date may be behind
LOOK_S = 0.01  # between looks at what the HTTP server still does at its end


class _HttpServer(uvicorn.Server):
    """uvicorn without its signal handlers and naps: the program has its own, and ends at once; `up`: it serves."""

    def __init__(self, config: uvicorn.Config, *, connection_limits: ConnectionLimits, tls: HttpTls | None) -> None:
        super().__init__(config)
        self.up = asyncio.Event()
        self._ending = asyncio.get_running_loop().create_future()
        self._connection_limits = connection_limits
        self._tls = tls
        self._accepting: list[asyncio.Task[None]] = []

    @contextlib.contextmanager
    def capture_signals(self) -> Iterator[None]:
        """Leave signals alone."""
        yield

    async def startup(self, sockets: list[socket.socket] | None = None) -> None:
        """Start, then say so. Behind TLS the connections are accepted by us: see tls_accept.py."""
        tls = self._tls
        await super().startup(sockets if tls is None else [])
        if tls is not None:
            for listener in sockets or ():
                acceptor = TlsAcceptor(
                    listener, connection_limits=self._connection_limits, context=tls.context, protocol=self._protocol
                )
                self._accepting.append(asyncio.get_running_loop().create_task(acceptor.run()))
        self.up.set()

    async def main_loop(self) -> None:
        """Until the end."""
        while not await self.on_tick(0):
            await asyncio.wait({self._ending}, timeout=DATE_S)

    async def shutdown(self, sockets: list[socket.socket] | None = None) -> None:
        """Take nobody any more, let what is under way finish within its time, then cancel it."""
        for task in self._accepting:
            task.cancel()
        for server in self.servers:
            server.close()
        for listener in sockets or ():
            listener.close()
        state = self.server_state
        for connection in list(state.connections):
            connection.shutdown()
        await asyncio.sleep(0)  # in which idle connections end
        loop = asyncio.get_running_loop()
        latest_s = loop.time() + (self.config.timeout_graceful_shutdown or 0.0)
        while state.connections or state.tasks:
            if loop.time() >= latest_s:
                log.warning("ending: %d requests were not done in time, and are cut", len(state.tasks))
                for work in state.tasks:
                    work.cancel()
                return
            await asyncio.sleep(LOOK_S)

    async def end(self, serving: asyncio.Task[None]) -> None:
        """Close sockets, finish requests, as far as they are done in time; `serving` is the task of `serve`."""
        self.should_exit = True
        if not self._ending.done():
            self._ending.set_result(None)
        await asyncio.wait({serving})

    def _protocol(self, connection: Connection) -> asyncio.Protocol:
        made: Any = self.config.http_protocol_class
        state = {"server_state": self.server_state, "app_state": self.lifespan.state}
        protocol: asyncio.Protocol = made(config=self.config, **state, connection=connection)
        return protocol


async def serve(
    settings: Settings,
    stop: asyncio.Event,
    *,
    clock: Clock | None = None,
    authenticator: Authenticator | None = None,
    passwords: Passwords | None = None,
    on_ready: Callable[[Ready], None] = lambda ready: None,
) -> None:
    """Run a gateway in this event loop until `stop` is set.

    `authenticator` knows credentials beside its own, `passwords` hashes them otherwise.
    """
    with listen_all(settings.host, _ports(settings)) as listeners:
        gateway = Gateway(settings, clock=clock or SystemClock(), authenticator=authenticator, passwords=passwords)
        try:
            await gateway.start()
            await _serve(gateway, listeners, stop, on_ready)
        finally:
            for listener in filter(None, listeners):
                listener.close()
            await gateway.stop()


async def _serve(
    gateway: Gateway, listeners: Listeners, stop: asyncio.Event, on_ready: Callable[[Ready], None]
) -> None:
    robots, gateway.grpc_port = _robots_server(gateway)
    programs, gateway.programs_port = _programs_server(gateway)
    connection_limits = _connection_limits(gateway)
    gateway.operations.connections = lambda: len(connection_limits)
    http = _HttpServer(
        _http_config(gateway, connection_limits, listeners), connection_limits=connection_limits, tls=gateway.tls
    )
    await robots.start()
    await programs.start()
    try:
        async with asyncio.TaskGroup() as group:
            web = group.create_task(http.serve(sockets=list(filter(None, listeners))))
            work = group.create_task(gateway.run())
            sweeping = group.create_task(connection_limits.run())
            watchdog = group.create_task(watchdog_loop())
            starting = group.create_task(http.up.wait())
            await asyncio.wait({web, starting}, return_when=asyncio.FIRST_COMPLETED)
            on_ready(_ready(gateway, listeners, gateway.programs_port))
            await stop.wait()
            notify_systemd(ENDING)
            await drain(gateway, robots=robots, programs=programs, end_http=lambda: http.end(web))
            work.cancel()
            sweeping.cancel()
            watchdog.cancel()
    finally:
        await asyncio.gather(robots.stop(0), programs.stop(0))
        connection_limits.close()


def _ports(settings: Settings) -> tuple[PortChoice, ...]:
    """The ports that speak HTTP: the main one, Foxglove's and rosbridge's."""
    return (
        PortChoice(settings.port, DEFAULT_HTTP_PORT, "--port"),
        PortChoice(settings.foxglove_port, DEFAULT_FOXGLOVE_PORT, "--foxglove-port"),
        PortChoice(settings.rosbridge_port, DEFAULT_ROSBRIDGE_PORT, "--rosbridge-port"),
    )


def _ready(gateway: Gateway, listeners: Listeners, api_grpc_port: int) -> Ready:
    own, (http_port, foxglove_port, rosbridge_port) = gateway.settings, map(port_of, listeners)
    return Ready(
        own.host,
        http_port,
        gateway.grpc_port,
        own.data_dir,
        tls=own.tls_on,
        public_host=own.public_host,
        roots_pem=gateway.identities.authorities.roots_pem if own.tls_on else "",
        api_grpc_port=api_grpc_port,
        foxglove_port=foxglove_port,
        rosbridge_port=rosbridge_port,
    )


def _robots_server(gateway: Gateway) -> tuple[grpc.aio.Server, int]:
    """Where robots connect, and its port."""
    own = gateway.settings
    return _grpc_server(
        own.host,
        PortChoice(own.grpc_port, DEFAULT_GRPC_PORT, "--grpc-port"),
        lambda server: add_links(server, gateway.links),
        connections=LIMITS.robots_connections,
        tls=(lambda: _robots_tls(gateway)) if own.robots_tls else None,
    )


def _programs_server(gateway: Gateway) -> tuple[grpc.aio.Server, int]:
    """Where people's programs connect, and its port."""
    own, authorizer = gateway.settings, CallAuthorizer(cache(partial(services_of, gateway)))
    return _grpc_server(
        own.host,
        PortChoice(own.api_grpc_port, DEFAULT_API_GRPC_PORT, "--api-grpc-port"),
        lambda server: add_programs(server, authorizer),
        connections=LIMITS.programs_connections,
        tls=(lambda: _programs_tls(gateway)) if own.robots_tls else None,
    )


def _grpc_server(
    host: str,
    choice: PortChoice,
    add: Callable[[grpc.aio.Server], None],
    *,
    connections: int,
    tls: Callable[[], ServerTls] | None,
) -> tuple[grpc.aio.Server, int]:
    """A server on a port that can be had; a default one that is taken moves to a free one.

    gRPC reports a taken port late and without its owner, so it is tried first; somebody may still be quicker.
    """
    with listen(host, choice.port, default=choice.default, flag=choice.flag) as probe:
        port = int(probe.getsockname()[1])
    try:
        return make_server(add, host=host, port=port, connections=connections, tls=tls)
    except ConfigError:
        if choice.port is not None:
            raise
        return make_server(add, host=host, port=0, connections=connections, tls=tls)


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


def _connection_limits(gateway: Gateway) -> ConnectionLimits:
    """Who may be connected to the HTTP port: of this machine and of proxies many."""
    proxies = gateway.settings.proxies

    def is_shared(text: str) -> bool:
        address = read_address(text)
        return address is not None and (address.is_loopback or is_within(address, proxies))

    return ConnectionLimits(clock=gateway.clock, is_shared=is_shared, files=open_files())


def _http_config(gateway: Gateway, connection_limits: ConnectionLimits, listeners: Listeners) -> uvicorn.Config:
    tls = gateway.tls
    protocol_ports = zip(map(port_of, listeners[1:]), (FOXGLOVE, ROSBRIDGE), strict=True)
    api = ProtocolPorts(create_app(gateway), {port: path for port, path in protocol_ports if port})
    http, socket_protocol = protocols(connection_limits, clock=gateway.clock)
    return uvicorn.Config(
        strict_transport(api, tls) if tls is not None else api,
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
        timeout_graceful_shutdown=math.ceil(gateway.settings.drain_s),
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
    shorten_switch_interval(SWITCH_INTERVAL_S)  # else live samples wait whenever the store's threads compute
    set_up_logs(form=settings.log_format, level=settings.log_level)
    access = LocalAccess(settings.data_dir)

    def ready(where: Ready) -> None:
        print(ready_line(settings, where), flush=True)
        access.begin(where)
        if status_file is not None:
            write_status(status_file, where)
        notify_systemd(READY)
        tune_garbage_collector()

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
