"""The checks of `metaros doctor`, in the order of the hops a sample takes: Python, Zenoh, router, graph, gateway."""

from __future__ import annotations

import platform
import shutil
import sys
from collections.abc import Iterator
from dataclasses import dataclass
from importlib.metadata import version
from pathlib import Path
from typing import TYPE_CHECKING, Any

from metaros.access.credentials import key_for, local_gateway
from metaros.cli.shared.extras import EXTRAS, missing_modules
from metaros.cli.shared.instances import data_root, running_instances
from metaros.cli.shared.output import counted, human_bytes
from metaros.cli.shared.ports import port_accepts, port_owner
from metaros.cli.up import ready
from metaros.clock import Clock
from metaros.errors import MetarosError

if TYPE_CHECKING:
    from metaros.node import Context

__all__ = ["Doctor", "Finding"]

CANARY_ROUNDS = 20
LOW_DISK_BYTES = 1_000_000_000
EARLIEST_WALL_NS = 1_767_225_600 * 10**9  # 2026-01-01: a clock before this was never set


@dataclass(frozen=True, slots=True)
class Finding:
    """One check's outcome: ok, note (nothing wrong, worth knowing), warning or failed."""

    check: str
    state: str
    text: str
    fix: str = ""


class Doctor:
    """Runs the checks; later ones are left out where an earlier one makes them pointless."""

    def __init__(self, *, port: int | None, data_dir: Path | None, zenoh_port: int, domain: int, clock: Clock) -> None:
        self._port = port
        self._data_dir = data_dir
        self._zenoh_port = zenoh_port
        self._domain = domain
        self._clock = clock

    def findings(self) -> Iterator[Finding]:
        """Every finding as it is made."""
        yield self._python()
        yield from self._extras()
        yield self._wall_clock()
        yield self._disk()
        zenoh = self._zenoh()
        yield zenoh
        if zenoh.state == "ok":
            router = self._router()
            yield router
            if router.state == "ok":
                yield from self._graph()
        yield from self._gateway()

    def _python(self) -> Finding:
        text = f"{platform.python_version()} on {platform.system()} {platform.machine()} ({sys.executable})"
        if sys.version_info < (3, 11):  # noqa: UP036  (a machine may run us with an older one all the same)
            return Finding("Python", "failed", text, "install Python 3.11 or newer")
        return Finding("Python", "ok", text)

    def _extras(self) -> Iterator[Finding]:
        lacking = {extra: missing for extra in EXTRAS if (missing := missing_modules(extra))}
        present = [extra for extra in EXTRAS if extra not in lacking]
        if present:
            yield Finding("Extras", "ok", ", ".join(present))
        for extra, missing in lacking.items():
            text = f"{extra} is not installed (no {', '.join(missing)})"
            yield Finding("Extras", "note", text, f"if you need it: pip install 'metaros[{extra}]'")

    def _wall_clock(self) -> Finding:
        if self._clock.wall_ns() < EARLIEST_WALL_NS:
            return Finding("Clock", "failed", "the calendar is before 2026", "set the time, or run an NTP client")
        return Finding("Clock", "ok", "the calendar is set")

    def _disk(self) -> Finding:
        place = self._data_dir or data_root()
        while not place.exists():
            place = place.parent
        free = shutil.disk_usage(place).free
        text = f"{human_bytes(free)} free on the disk of {place}"
        if free < LOW_DISK_BYTES:
            return Finding("Disk", "warning", text, "make room, or choose another place with --data-dir")
        return Finding("Disk", "ok", text)

    def _zenoh(self) -> Finding:
        try:
            import zenoh  # noqa: F401  (whether it loads is the question)
        except ImportError as error:
            return Finding("Zenoh", "failed", f"cannot be imported: {error}", "pip install 'eclipse-zenoh>=1.10,<2'")
        return Finding("Zenoh", "ok", f"eclipse-zenoh {version('eclipse-zenoh')}")

    def _router(self) -> Finding:
        from metaros.wire.router import probe

        where = f"127.0.0.1:{self._zenoh_port}"
        state = probe(self._zenoh_port)
        if state == "zenoh":
            return Finding("Router", "ok", f"Zenoh router on {where}")
        if state == "free":
            fix = "start one: `metaros up` (a whole fleet) or `metaros router`"
            return Finding("Router", "failed", f"no Zenoh router on {where}", fix)
        owner = port_owner(self._zenoh_port)
        fix = "`metaros router --port PORT` on a free port, then --zenoh-port PORT or METAROS_ZENOH_PORT"
        return Finding("Router", "failed", f"{where} belongs to {owner}, which is no Zenoh router", fix)

    def _graph(self) -> Iterator[Finding]:
        from metaros.cli.shared.connection import connect

        try:
            with connect(self._zenoh_port, self._domain, spin_time=1.0) as context:
                nodes, topics = len(context.graph.nodes()), len(context.graph.topics())
                seen = f"{counted(nodes, 'node')}, {counted(topics, 'topic')}"
                yield Finding("Graph", "ok", f"{seen} in ROS domain {self._domain}")
                yield self._canary(context)
        except MetarosError as error:
            first, _, fix = str(error).partition("\n")
            yield Finding("Graph", "failed", first, fix)

    def _canary(self, context: Context) -> Finding:
        """A message through the router to a second session and back to this process, several times."""
        from metaros.cli.doctor.latency_probe import round_trips

        times = sorted(round_trips(context, zenoh_port=self._zenoh_port, domain=self._domain, rounds=CANARY_ROUNDS))
        if len(times) < CANARY_ROUNDS:
            text = f"{len(times)} of {CANARY_ROUNDS} messages came through"
            return Finding("Canary", "failed", text, "is a firewall or an access rule between the sessions?")
        middle, worst = times[len(times) // 2] * 1e3, times[-1] * 1e3
        return Finding("Canary", "ok", f"publish to subscribe {middle:.2f} ms (worst {worst:.2f} ms)")

    def _gateway(self) -> Iterator[Finding]:
        instances = running_instances()
        places = [_place(self._port)] if self._port else [found.url for found in instances]
        if not places and port_accepts(8080) and ready.get_json(_place(8080), "/healthz")[0] == 200:
            places = [_place(8080)]
        if not places:
            yield Finding("Gateway", "note", "none runs here", "start one: `metaros up` or `metaros gateway`")
        for where in places:
            yield self._one_gateway(where)

    def _one_gateway(self, where: str) -> Finding:
        status, body = ready.get_json(where, "/readyz")
        if status == 0:
            return Finding("Gateway", "failed", f"nobody answers on {where}", "`metaros status` shows whether one runs")
        if status != 200:
            return Finding("Gateway", "failed", f"{where} is not ready: {_failing(body)}", "see its log file")
        online = ready.robots_online(where, key=key_for(where))
        return Finding("Gateway", "ok", f"{where} is ready, {len(online)} robots online")


def _place(port: int) -> str:
    """The address of the gateway that has the port, as it told this user: http or https."""
    known = local_gateway()
    return known if known.endswith(f":{port}") else f"http://127.0.0.1:{port}"


def _failing(body: Any) -> str:
    """The checks of /readyz that are not well."""
    checks = body.get("checks", {}) if isinstance(body, dict) else {}
    bad = [f"{name}: {value}" for name, value in checks.items() if value not in (True, "ok")]
    return ", ".join(bad) or "it does not say why"
