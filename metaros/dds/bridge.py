"""The DDS bridge: routes for what both sides have, kept up by one thread that owns every DDS entity."""

from __future__ import annotations

import logging
import threading
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any, Final

from cyclonedds.core import DDSException, GuardCondition, ReadCondition, SampleState, ViewState, WaitSet
from cyclonedds.core import InstanceState as Instances
from cyclonedds.domain import DomainParticipant

from metaros.concurrency.waiting import pause
from metaros.dds.discovery import Discovery
from metaros.dds.plan import Plan, RouteKey, Wanted, make_plan
from metaros.dds.report import DdsReport, Direction
from metaros.dds.service_routes import ServedByDds, ServedByRos
from metaros.dds.topic_routes import FromDds, ToDds
from metaros.errors import ConfigError, MetarosError
from metaros.executor import SingleThreadedExecutor
from metaros.idl import catalogue_of
from metaros.idl.globs import Glob
from metaros.limits import LIMITS
from metaros.node import Context, Node

__all__ = ["DdsBridge", "DdsOptions"]

_log = logging.getLogger("metaros.dds")
_TICK_NS: Final = 250_000_000
_ANY: Final = ViewState.Any | Instances.Any | SampleState.NotRead
Route = FromDds | ToDds | ServedByDds | ServedByRos


@dataclass(frozen=True, slots=True, kw_only=True)
class DdsOptions:
    """`domain` is DDS's, as ROS_DOMAIN_ID; `only` and `exclude` choose topics and services by their ROS names."""

    domain: int = 0
    only: tuple[Glob, ...] = ()
    exclude: tuple[Glob, ...] = ()
    services: bool = True

    def allows(self, name: str) -> bool:
        """Whether this name is bridged."""
        chosen = not self.only or any(glob.matches(name) for glob in self.only)
        return chosen and not any(glob.matches(name) for glob in self.exclude)


class DdsBridge:
    """Runs from its making until `close`; a context manager. One bridge a DDS domain: two would echo each other."""

    def __init__(self, context: Context, options: DdsOptions | None = None) -> None:
        self._options = DdsOptions() if options is None else options
        self._participant = _join(self._options.domain)
        self._discovery = Discovery(self._participant)
        self._wake = GuardCondition(self._participant)
        self._waits = WaitSet(self._participant)
        self._routes: dict[RouteKey, Route] = {}
        self._made: dict[RouteKey, Wanted] = {}  # what each route was made for, also where that failed
        self._conditions: dict[RouteKey, ReadCondition] = {}
        self._plan = Plan()
        self._graph_changed = True
        self._stopped = False
        for entity in (self._wake, *(ReadCondition(reader, _ANY) for reader in self._discovery.readers)):
            self._waits.attach(entity)
        self._node = Node("dds_bridge", context=context)  # last, so that nothing is left where DDS fails
        self._forget_graph = self._node.graph.on_change(self._on_graph)
        self._executor = SingleThreadedExecutor()
        self._executor.add_node(self._node)
        self._threads = [
            threading.Thread(target=run, name=f"metaros-dds-{name}", daemon=True)
            for name, run in (("bridge", self._run), ("node", self._executor.spin))
        ]
        for thread in self._threads:
            thread.start()

    def report(self) -> DdsReport:
        """What went through since the beginning."""
        rows = sorted((route.row() for route in list(self._routes.values())), key=lambda row: (row.name, row.direction))
        return DdsReport(rows=tuple(rows), participants=self._discovery.participants, problems=self._plan.problems)

    def close(self) -> None:
        """Leave both sides."""
        self._stopped = True
        self._wake.set(True)
        self._executor.shutdown()
        for thread in self._threads:
            thread.join()
        self._forget_graph()
        for key in list(self._routes):
            self._close_route(key)
        self._node.close()

    def __enter__(self) -> DdsBridge:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    # -- the bridge's thread ---------------------------------------------------------------------------------------

    def _on_graph(self) -> None:
        self._graph_changed = True
        self._wake.set(True)

    def _run(self) -> None:
        more = False
        while not self._stopped:
            try:
                self._waits.wait(0 if more else _TICK_NS)
                self._wake.set(False)
                more = self._step()
            except Exception:  # a fault of ours must not end the bridge
                if not self._stopped:
                    _log.exception("the bridge stumbled")
                    pause(_TICK_NS / 1e9)

    def _step(self) -> bool:
        """Everything that is to be done now; whether more waits."""
        graph_changed, self._graph_changed = self._graph_changed, False
        if self._discovery.refresh() or graph_changed:
            self._replan()
        more = False
        for key, route in list(self._routes.items()):
            try:
                more |= route.work()
            except Exception as error:  # of one route: the others go on
                self._warn_once((key, type(error)), f"{route.name}, {route.direction}: {error}")
        return more

    def _replan(self) -> None:
        """Make the routes that are wanted now, and end those that are not."""
        own = self._node.context.zid, self._node.full_name
        graph = [item for item in self._node.graph.endpoints() if (item.zid, item.node_full_name) != own]
        self._plan = make_plan(
            self._discovery.endpoints,
            graph,
            allows=self._options.allows,
            services=self._options.services,
            find=catalogue_of,
        )
        if self._discovery.left_out:
            text = f"DDS has more than {LIMITS.graph_entities} endpoints: what came later is not bridged"
            self._plan = replace(self._plan, problems=(*self._plan.problems, text))
        for key in [key for key, made in self._made.items() if self._plan.routes.get(key) != made]:
            self._close_route(key)
        for key, wanted in self._plan.routes.items():
            if key not in self._made:
                self._made[key] = wanted
                self._open_route(key, wanted)
        for problem in self._plan.problems:
            self._warn_once(problem, problem)

    def _open_route(self, key: RouteKey, wanted: Wanted) -> None:
        make = _MAKERS[key.direction]
        try:
            route = make(self, key.name, wanted)
            self._routes[key] = route
            if not isinstance(route, ToDds):
                condition = self._conditions[key] = ReadCondition(route.reader, _ANY)
                self._waits.attach(condition)
        except (MetarosError, DDSException) as error:
            self._warn_once((key, "open"), f"{key.name}, {key.direction}: {error}")

    def _close_route(self, key: RouteKey) -> None:
        self._made.pop(key, None)
        condition = self._conditions.pop(key, None)
        if condition is not None:
            self._waits.detach(condition)
        route = self._routes.pop(key, None)
        if route is not None:
            route.close()

    def _is_own(self, name: str, gid: bytes) -> bool:
        """Whether a sample in the ROS graph came from DDS through this bridge."""
        route = self._routes.get(RouteKey(Direction.TO_ROS, name))
        return isinstance(route, FromDds) and route.gid == gid

    def _warn_once(self, about: object, text: str) -> None:
        if self._node.first_report(("dds", about)):
            self._node.get_logger().warn(text)

    def _from_dds(self, name: str, wanted: Wanted) -> Route:
        options: Any = {"type_name": wanted.type_name, "catalogue": wanted.catalogue, "qos": wanted.qos}
        return FromDds(self._node, self._participant, name=name, **options)

    def _to_dds(self, name: str, wanted: Wanted) -> Route:
        return ToDds(
            self._node,
            self._participant,
            name=name,
            type_name=wanted.type_name,
            catalogue=wanted.catalogue,
            qos=wanted.qos,
            dds_qos=wanted.dds_qos,
            is_own=lambda gid: self._is_own(name, gid),
            wake=lambda: self._wake.set(True),
        )

    def _served_by_dds(self, name: str, wanted: Wanted) -> Route:
        options: Any = {"type_name": wanted.type_name, "catalogue": wanted.catalogue}
        return ServedByDds(self._node, self._participant, name=name, **options)

    def _served_by_ros(self, name: str, wanted: Wanted) -> Route:
        options: Any = {"type_name": wanted.type_name, "catalogue": wanted.catalogue}
        return ServedByRos(self._node, self._participant, name=name, **options)


def _join(domain: int) -> DomainParticipant:
    try:
        return DomainParticipant(domain)
    except DDSException as error:
        raise ConfigError(
            f"cannot join the DDS domain {domain}: {error}\nCYCLONEDDS_URI, where it is set, says by which network"
        ) from None


_MAKERS: Final[dict[Direction, Callable[[DdsBridge, str, Wanted], Route]]] = {
    Direction.TO_ROS: DdsBridge._from_dds,
    Direction.TO_DDS: DdsBridge._to_dds,
    Direction.SERVED_BY_DDS: DdsBridge._served_by_dds,
    Direction.SERVED_BY_ROS: DdsBridge._served_by_ros,
}
