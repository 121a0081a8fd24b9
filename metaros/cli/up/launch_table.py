"""The launch table of `metaros up`: which processes, in which order, with which arguments. Pure."""

from __future__ import annotations

import re
import sys
from collections.abc import Iterable
from dataclasses import dataclass, field
from pathlib import Path

from metaros.cli.shared.instances import gateway_folder
from metaros.supervise import Launch

__all__ = ["Plan", "Replica", "first_free_robot", "host_robot_name", "launches"]

ROUTER, GATEWAY, SIMULATOR, AGENTS = range(4)  # stages; they stop in falling order: agents first, router last
_SIM = re.compile(r"^sim_(\d+)$")


@dataclass(frozen=True, slots=True)
class Replica:
    """A further gateway of the same store, by its number from 2."""

    number: int
    http_port: int
    grpc_port: int

    @property
    def name(self) -> str:
        """Of its process, and of its folder with a dash."""
        return f"gateway {self.number}"


@dataclass(frozen=True, slots=True, kw_only=True)
class Plan:
    """All that was decided before anything is started."""

    host: str
    http_port: int
    grpc_port: int
    zenoh_port: int
    domain: int
    own_router: bool
    data_dir: Path
    robots: int
    first_robot: int
    seed: int
    host_robot: str  # empty: this machine is no robot
    camera: str  # empty: none
    protected: Path | None = None  # the folder of Zenoh's protected profile; None: open
    tls: bool = False
    access: tuple[str, ...] = ()  # further options of the gateway: who may access it, and its host names
    database: str = field(default="", repr=False)  # PostgreSQL; "": a file
    replicas: tuple[Replica, ...] = ()  # beside the first gateway
    cluster_port: int = 0  # of the router between them

    @property
    def root_file(self) -> Path | None:
        """The root that vouches for the gateway; None without TLS."""
        return gateway_folder(self.data_dir.resolve()) / "root.pem" if self.tls else None

    @property
    def robot_names(self) -> tuple[str, ...]:
        """Every robot that is to be online."""
        return (*self.simulated, self.host_robot) if self.host_robot else self.simulated

    @property
    def simulated(self) -> tuple[str, ...]:
        """The simulated robots' names."""
        return tuple(f"sim_{number}" for number in range(self.first_robot, self.first_robot + self.robots))

    @property
    def url(self) -> str:
        """Where a browser goes."""
        host = {"0.0.0.0": "127.0.0.1", "::": "::1"}.get(self.host, self.host)
        scheme = "https" if self.tls else "http"
        return f"{scheme}://[{host}]:{self.http_port}" if ":" in host else f"{scheme}://{host}:{self.http_port}"

    @property
    def link(self) -> str:
        """Where the agents of this machine connect."""
        host = {"0.0.0.0": "127.0.0.1", "::": "::1"}.get(self.host, self.host)
        place = f"[{host}]:{self.grpc_port}" if ":" in host else f"{host}:{self.grpc_port}"
        return f"grpcs://{place}" if self.tls else place

    @property
    def replica_urls(self) -> tuple[str, ...]:
        """Where the further gateways serve; they are on this machine alone, without TLS."""
        return tuple(f"http://127.0.0.1:{replica.http_port}" for replica in self.replicas)

    def links_of(self, position: int) -> str:
        """Where a robot connects, each beginning with another gateway so that they spread; `position` counts robots."""
        links = [self.link, *(f"127.0.0.1:{replica.grpc_port}" for replica in self.replicas)]
        first = position % len(links)
        return ",".join(links[first:] + links[:first])

    @property
    def log_dir(self) -> Path:
        """Where each process has its log file."""
        return self.data_dir / "logs"

    @property
    def run_dir(self) -> Path:
        """Where the status files are."""
        return self.data_dir / "run"

    def status_file(self, name: str) -> Path:
        """The file a process writes when it is ready."""
        return self.run_dir / f"{name}.json"


def launches(plan: Plan) -> tuple[Launch, ...]:
    """The table, in the order of start."""
    rows = [_router(plan) if plan.own_router else _standby_router(plan)]
    if plan.replicas:
        rows.append(_row(plan, "cluster router", ROUTER, "router", "--port", str(plan.cluster_port)))
    rows.append(_gateway(plan))
    rows.extend(_replica(plan, replica) for replica in plan.replicas)
    if plan.robots:
        rows.append(_simulator(plan))
    rows.extend(_agent(plan, name, position) for position, name in enumerate(plan.simulated))
    if plan.host_robot:
        rows.append(_host_agent(plan))
        if plan.camera:
            rows.append(_camera(plan))
    return tuple(rows)


def host_robot_name(hostname: str) -> str:
    """This machine's name as a robot: lower case, letters, digits and underscores, never one of the simulator's."""
    name = re.sub(r"[^a-z0-9_]+", "_", hostname.split(".")[0].lower()).strip("_") or "host"
    return f"host_{name}" if not name[0].isalpha() or _SIM.match(name) else name


def first_free_robot(names: Iterable[str]) -> int:
    """The first number N such that `sim_N` and all after it are free; `names` are robots or namespaces in use."""
    numbers = [int(match[1]) for name in names if (match := _SIM.match(name.strip("/").split("/")[0]))]
    return max(numbers, default=0) + 1


def _row(plan: Plan, name: str, stage: int, *arguments: str) -> Launch:
    return Launch(
        name=name,
        argv=(sys.executable, "-m", "metaros", *arguments),
        log_path=plan.log_dir / f"{name.replace(' ', '-')}.log",
        stage=stage,
        env={
            "ROS_DOMAIN_ID": str(plan.domain),
            "PYTHONUNBUFFERED": "1",
            **_session(plan, stage),
            **_store(plan, stage),
        },
    )


def _session(plan: Plan, stage: int) -> dict[str, str]:
    """Which session file a process has: what is no agent may not drive. The router made it before it was ready."""
    if plan.protected is None or stage != SIMULATOR:
        return {}
    return {"ZENOH_SESSION_CONFIG_URI": str(plan.protected / "node.json5")}


def _store(plan: Plan, stage: int) -> dict[str, str]:
    """Which database gateways use: a URL may hold a password, which is nothing for the list of processes."""
    return {"METAROS_STORE": plan.database} if plan.database and stage == GATEWAY else {}


def _shared(plan: Plan) -> tuple[str, ...]:
    """What gateways need that are replicas of one another."""
    if not plan.replicas:
        return ()
    folder = plan.data_dir.resolve()
    objects, key = (folder / "objects").as_uri(), gateway_folder(folder) / "master.key"
    return ("--cluster", f"tcp/127.0.0.1:{plan.cluster_port}", "--objects", objects, "--master-key", str(key))


def _profile(plan: Plan) -> tuple[str, ...]:
    if plan.protected is None:
        return ()
    return ("--zenoh-profile", "protected", "--zenoh-credentials", str(plan.protected))


def _zenoh(plan: Plan) -> tuple[str, ...]:
    return ("--zenoh-port", str(plan.zenoh_port))


def _router(plan: Plan) -> Launch:
    status = str(plan.status_file("router"))
    place = ("--port", str(plan.zenoh_port), *_profile(plan))
    return _row(plan, "router", ROUTER, "router", *place, "--status-file", status)


def _standby_router(plan: Plan) -> Launch:
    """Where a router was joined: hosts one as soon as that ends."""
    return _row(plan, "standby router", ROUTER, "router", "--port", str(plan.zenoh_port), "--standby")


def _gateway(plan: Plan) -> Launch:
    ports = ("--host", plan.host, "--port", str(plan.http_port), "--grpc-port", str(plan.grpc_port))
    places = ("--data-dir", str(gateway_folder(plan.data_dir)), "--status-file", str(plan.status_file("gateway")))
    tls = ("--tls", "on" if plan.tls else "off")
    return _row(plan, "gateway", GATEWAY, "gateway", *ports, *places, *tls, *plan.access, *_shared(plan))


def _replica(plan: Plan, replica: Replica) -> Launch:
    folder = replica.name.replace(" ", "-")
    ports = ("--port", str(replica.http_port), "--grpc-port", str(replica.grpc_port))
    places = ("--data-dir", str(plan.data_dir / folder), "--status-file", str(plan.status_file(folder)))
    return _row(plan, replica.name, GATEWAY, "gateway", *ports, *places, "--tls", "off", *plan.access, *_shared(plan))


def _simulator(plan: Plan) -> Launch:
    numbers = ("--robots", str(plan.robots), "--first", str(plan.first_robot), "--seed", str(plan.seed))
    status = ("--status-file", str(plan.status_file("sim")))
    return _row(plan, "sim", SIMULATOR, "sim", *numbers, *_zenoh(plan), *status)


def _agent(plan: Plan, name: str, position: int) -> Launch:
    link = ("--gateway", plan.links_of(position), *_zenoh(plan))
    who = ("--name", name, "--namespace", f"/{name}", *_state_dir(plan, name))
    return _row(plan, f"agent {name}", AGENTS, "agent", *who, *link, *_profile(plan), "--no-host-metrics")


def _host_agent(plan: Plan) -> Launch:
    link = ("--gateway", plan.links_of(plan.robots), *_zenoh(plan), "--exclude", "/sim_*/**")
    name = plan.host_robot
    who = ("--name", name, "--namespace", "/", *_state_dir(plan, name))
    return _row(plan, f"agent {name}", AGENTS, "agent", *who, *link, *_profile(plan), "--host-metrics")


def _state_dir(plan: Plan, name: str) -> tuple[str, ...]:
    """An agent's outbox is the instance's: another instance's robots may have the same names."""
    return ("--state-dir", str(plan.data_dir / "agents" / name))


def _camera(plan: Plan) -> Launch:
    source = ("--param", f"source={plan.camera}")
    return _row(plan, "camera", SIMULATOR, "driver", "run", "camera", *source, *_zenoh(plan))
