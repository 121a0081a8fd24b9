"""The plan of `metaros up`: ports, router and robot numbers, chosen and claimed before anything is started."""

from __future__ import annotations

import ipaddress
import os
import socket
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import TYPE_CHECKING

from metaros.cli.shared.instances import DataDir, Instance, running_instances
from metaros.cli.shared.options import DEFAULT_ZENOH_PORT
from metaros.cli.shared.ports import PortChoice, choose_port, port_free, port_owner
from metaros.cli.up.launch_table import Plan, Replica, first_free_robot, host_robot_name
from metaros.clock import Clock
from metaros.errors import ConfigError, UnavailableError

if TYPE_CHECKING:
    from metaros.cli.up.screen import Screen

__all__ = ["UpOptions", "claim", "lost_ports", "make_plan"]

HTTP_PORT, GRPC_PORT = 8080, 8081
CLUSTER_PORT = 7457
MOST_REPLICAS = 5
# Who has to move takes none of these: gateways open the last three by themselves, maybe a moment after we looked.
KNOWN_PORTS = (HTTP_PORT, GRPC_PORT, DEFAULT_ZENOH_PORT, 8082, 8765, 9090)


@dataclass(frozen=True, slots=True, kw_only=True)
class UpOptions:
    """What the user asked for; None is "not said"."""

    host: str = "127.0.0.1"
    port: int | None = None
    grpc_port: int | None = None
    zenoh_port: int | None = None
    domain: int = 0
    robots: int = 3
    data_dir: Path | None = None
    seed: int = 1
    host_robot: bool = True
    camera: str = ""
    protected: Path | None = None  # the folder of Zenoh's protected profile; None: open
    tls: str = "auto"
    tls_cert: Path | None = None
    tls_key: Path | None = None
    allow_hosts: tuple[str, ...] = ()
    anonymous: bool = True
    replicas: int = 1
    database: str = field(default="", repr=False)

    @property
    def tls_on(self) -> bool:
        """Whether the gateway speaks TLS: as it decides it itself."""
        return self.tls == "on" or (self.tls == "auto" and (self.tls_cert is not None or not _is_loopback(self.host)))

    @property
    def access(self) -> tuple[str, ...]:
        """The gateway's options of who may access it."""
        pair = (("--tls-cert", self.tls_cert), ("--tls-key", self.tls_key))
        files = [text for flag, path in pair if path is not None for text in (flag, str(path))]
        names = [text for name in self.allow_hosts for text in ("--allow-host", name)]
        return (*files, *names, *(() if self.anonymous else ("--no-anonymous",)))


def make_plan(options: UpOptions, data: DataDir, screen: Screen, *, lost: Sequence[int] = ()) -> Plan:
    """Choose ports and robot numbers that nobody has; called under the claim lock. Who moves takes none that was lost
    at an earlier start.
    """
    if options.tls not in ("auto", "on", "off"):
        raise ConfigError(f"--tls {options.tls}: it is auto, on or off")
    _check_replicas(options)
    others = running_instances()
    taken = [port for other in others for port in (other.http_port, other.grpc_port)]
    avoid = (*KNOWN_PORTS, *lost, *filter(None, (options.port, options.grpc_port, options.zenoh_port)))
    http = choose_port("dashboard", options.port, HTTP_PORT, host=options.host, taken=taken, avoid=avoid)
    for option, number in (("--grpc-port", options.grpc_port), ("--zenoh-port", options.zenoh_port)):
        if number == http.port:
            raise ConfigError(f"{option} and the dashboard's port are both {number}")
    grpc = choose_port(
        "agents' link", options.grpc_port, GRPC_PORT, host=options.host, taken=[*taken, http.port], avoid=avoid
    )
    if grpc.wanted == http.port:
        grpc = replace(grpc, owner="the dashboard")
    for what, choice in (("the dashboard", http), ("the agents' link", grpc)):
        _say_moved(screen, what, choice)
    zenoh_port, own_router = _router(options, others, screen, avoid=avoid)
    claimed = [*taken, http.port, grpc.port, zenoh_port]
    replicas, cluster_port = _replicas(options, claimed, avoid=avoid)
    names = [name for other in others if other.zenoh_port == zenoh_port for name in other.robots]
    graph = [] if own_router else _graph_names(zenoh_port, options.domain)
    simulated = first_free_robot([*names, *graph])
    if simulated > 1 and options.robots:
        there = "sim_1 exists" if simulated == 2 else f"sim_1 to sim_{simulated - 1} exist"
        screen.note(f"{there} already: this instance's robots start at sim_{simulated}")
    return Plan(
        host=options.host,
        http_port=http.port,
        grpc_port=grpc.port,
        zenoh_port=zenoh_port,
        domain=options.domain,
        own_router=own_router,
        data_dir=data.path,
        robots=options.robots,
        first_robot=simulated,
        seed=options.seed,
        host_robot=host_robot_name(socket.gethostname()) if options.host_robot else "",
        camera=options.camera,
        protected=options.protected,
        tls=options.tls_on,
        access=options.access,
        database=options.database,
        replicas=replicas,
        cluster_port=cluster_port,
    )


def _check_replicas(options: UpOptions) -> None:
    if not 1 <= options.replicas <= MOST_REPLICAS:
        raise ConfigError(f"--replicas is 1 to {MOST_REPLICAS}, not {options.replicas}")
    if options.replicas == 1:
        return
    if not options.database:
        raise ConfigError("--replicas needs --database postgresql://…: gateways of one fleet share their store")
    if options.tls_on or not _is_loopback(options.host):
        raise ConfigError(
            "--replicas is for this machine alone: leave --host and --tls out, or see docs/howto/replicas.md"
        )


def _replicas(options: UpOptions, claimed: Sequence[int], *, avoid: Sequence[int]) -> tuple[tuple[Replica, ...], int]:
    """Ports of the further gateways, and of the router between them all."""
    found: list[Replica] = []
    used = list(claimed)

    def take(what: str, default: int) -> int:
        used.append(choose_port(what, None, default, taken=used, avoid=avoid).port)
        return used[-1]

    for number in range(2, options.replicas + 1):
        base = HTTP_PORT + 100 * (number - 1)
        found.append(Replica(number, take(f"gateway {number}", base), take(f"links of gateway {number}", base + 1)))
    return tuple(found), take("the replicas' router", CLUSTER_PORT) if found else 0


def lost_ports(options: UpOptions, plan: Plan, name: str, said: Sequence[str]) -> list[int]:
    """Ports that we chose for a process which did not get them: its last words name them, or somebody has them now.

    Its words count because who had a port for a moment, as an outgoing connection does, may be gone by now.
    """
    gateway, router = options.host, "127.0.0.1"
    chosen = {
        "gateway": ((options.port, plan.http_port, gateway), (options.grpc_port, plan.grpc_port, gateway)),
        "router": ((options.zenoh_port, plan.zenoh_port, router),),
        "cluster router": ((None, plan.cluster_port, router),),
        **{one.name: ((None, one.http_port, router), (None, one.grpc_port, router)) for one in plan.replicas},
    }
    ours = [(port, host) for named, port, host in chosen.get(name, ()) if named is None]
    words = "\n".join(said)
    return [port for port, host in ours if f"port {port} " in words or not port_free(port, host=host)]


def _is_loopback(host: str) -> bool:
    try:
        return ipaddress.ip_address(host).is_loopback
    except ValueError:
        return host == "localhost"


def _say_moved(screen: Screen, what: str, choice: PortChoice) -> None:
    if choice.moved:
        screen.note(f"port {choice.wanted} is in use by {choice.owner}: {what} moves to {choice.port}")


def _router(options: UpOptions, others: list[Instance], screen: Screen, *, avoid: Sequence[int]) -> tuple[int, bool]:
    """The Zenoh port, and whether we host the router there: a router that exists is joined, never doubled."""
    from metaros.wire.router import probe

    wanted = options.zenoh_port or DEFAULT_ZENOH_PORT
    state = probe(wanted)
    running = state == "zenoh" or any(other.zenoh_port == wanted for other in others)
    if running and options.protected is not None:
        raise ConfigError(f"a Zenoh router has port {wanted} already: a protected one needs another, --zenoh-port PORT")
    if running:
        screen.note(f"a Zenoh router runs already on port {wanted}: joining it")
        return wanted, False
    if state == "free":
        return wanted, True
    owner = port_owner(wanted)
    if options.zenoh_port is not None:
        raise ConfigError(f"port {wanted} (Zenoh) is in use by {owner}, which is no Zenoh router")
    choice = choose_port("Zenoh", None, wanted, taken=[other.zenoh_port for other in others], avoid=avoid)
    screen.note(f"port {wanted} is in use by {owner}, no Zenoh router: ours moves to {choice.port}")
    return choice.port, True


def _graph_names(zenoh_port: int, domain: int) -> list[str]:
    """Namespaces and topics on the router that we join."""
    from metaros.cli.shared.connection import open_graph

    try:
        with open_graph(zenoh_port, domain, spin_time=1.0) as graph:
            return [*(node.namespace for node in graph.nodes()), *graph.topics()]
    except UnavailableError:  # claimed by an instance that is still starting
        return []


def claim(plan: Plan, clock: Clock) -> Instance:
    """What other instances are to leave alone."""
    return Instance(
        pid=os.getpid(),
        state="starting",
        url=plan.url,
        host=plan.host,
        http_port=plan.http_port,
        grpc_port=plan.grpc_port,
        zenoh_port=plan.zenoh_port,
        domain=plan.domain,
        own_router=plan.own_router,
        robots=plan.robot_names,
        data_dir=str(plan.data_dir),
        started_ns=clock.wall_ns(),
    )
