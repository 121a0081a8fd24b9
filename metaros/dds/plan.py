"""Which routes a bridge needs, from who is on either side. Pure."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass, field
from uuid import UUID

from metaros.dds.names import Kind
from metaros.dds.report import Direction
from metaros.idl import Catalogue
from metaros.limits import LIMITS
from metaros.wire import Durability, EndpointInfo, QoSProfile, qos_services
from metaros.wire.matching import reading_qos

__all__ = ["DdsEndpoint", "FindType", "Plan", "RouteKey", "Wanted", "make_plan"]

_CYCLONE = b"\x01\x10"  # the vendor's id, with which a GUID begins
FindType = Callable[[str, str], Catalogue | None]  # name and hash, which may be ""


@dataclass(frozen=True, slots=True)
class DdsEndpoint:
    """One writer or reader of a ROS name. `type_hash` is "" where its owner does not tell."""

    writes: bool
    kind: Kind
    name: str
    type_name: str
    type_hash: str
    qos: QoSProfile
    participant: UUID

    @property
    def is_cyclone(self) -> bool:
        """Whether Cyclone DDS has made it, whose services carry their header in the payload."""
        return self.participant.bytes.startswith(_CYCLONE)


@dataclass(frozen=True, slots=True)
class RouteKey:
    """A topic and its direction, or a service and the side of its server."""

    direction: Direction
    name: str


@dataclass(frozen=True, slots=True)
class Wanted:
    """What a route carries, and how: `qos` in the ROS graph, `dds_qos` on DDS."""

    type_name: str
    catalogue: Catalogue = field(hash=False)
    qos: QoSProfile
    dds_qos: QoSProfile


@dataclass(frozen=True, slots=True)
class Plan:
    """The routes, and in words what cannot be bridged."""

    routes: dict[RouteKey, Wanted] = field(default_factory=dict)
    problems: tuple[str, ...] = ()


def make_plan(
    dds: Iterable[DdsEndpoint],
    graph: Sequence[EndpointInfo],
    *,
    allows: Callable[[str], bool],
    services: bool,
    find: FindType,
) -> Plan:
    """`dds` are endpoints of other participants, `graph` those of other nodes."""
    chosen = [endpoint for endpoint in dds if allows(endpoint.name)]
    routes: dict[RouteKey, Wanted] = {}
    problems: list[str] = []
    _plan_topics([item for item in chosen if item.kind is Kind.TOPIC], graph, find, routes, problems)
    if services:
        _plan_services([item for item in chosen if item.kind is not Kind.TOPIC], graph, find, routes, problems)
    if len(routes) > LIMITS.dds_routes:
        problems.append(f"{len(routes)} routes: the limit is {LIMITS.dds_routes}, the rest is not bridged")
        routes = dict(list(routes.items())[: LIMITS.dds_routes])
    return Plan(routes, tuple(problems))


def _plan_topics(
    found: list[DdsEndpoint],
    graph: Sequence[EndpointInfo],
    find: FindType,
    routes: dict[RouteKey, Wanted],
    problems: list[str],
) -> None:
    published = [item for item in graph if item.kind == "MP"]
    for name, ends in _by_name(found):
        known = _type_of(name, ends, find, problems)
        if known is None:
            continue
        type_name, catalogue = known
        writers = [end.qos for end in ends if end.writes]
        readers = [end.qos for end in ends if not end.writes]
        if writers:
            qos = reading_qos(writers)
            routes[RouteKey(Direction.TO_ROS, name)] = Wanted(type_name, catalogue, qos, qos)
        if readers:
            offered = reading_qos([item.qos for item in published if item.topic == name])
            kept = any(qos.durability is Durability.TRANSIENT_LOCAL for qos in readers)
            dds_qos = QoSProfile(depth=100, durability=Durability.TRANSIENT_LOCAL if kept else Durability.VOLATILE)
            routes[RouteKey(Direction.TO_DDS, name)] = Wanted(type_name, catalogue, offered, dds_qos)


def _plan_services(
    found: list[DdsEndpoint],
    graph: Sequence[EndpointInfo],
    find: FindType,
    routes: dict[RouteKey, Wanted],
    problems: list[str],
) -> None:
    served_by_ros = {item.topic for item in graph if item.kind == "SS"}
    foreign: set[str] = set()
    for name, ends in _by_name(found):
        requests = [end for end in ends if end.kind is Kind.REQUEST]
        on_dds = any(not end.writes for end in requests)
        if on_dds == (name in served_by_ros) or not requests:  # on both sides, or on none
            continue
        if not all(end.is_cyclone for end in requests):
            foreign.add(name)
            continue
        known = _type_of(name, requests, find, problems)
        if known is not None:
            direction = Direction.SERVED_BY_DDS if on_dds else Direction.SERVED_BY_ROS
            routes[RouteKey(direction, name)] = Wanted(*known, qos_services, qos_services)
    if foreign:
        problems.append(
            f"{len(foreign)} services are not bridged, such as {min(foreign)}: "
            "only Cyclone DDS's carry their caller in the payload, Fast DDS's do not"
        )


def _by_name(found: list[DdsEndpoint]) -> Iterator[tuple[str, list[DdsEndpoint]]]:
    names: dict[str, list[DdsEndpoint]] = {}
    for endpoint in found:
        names.setdefault(endpoint.name, []).append(endpoint)
    return iter(sorted(names.items()))


def _type_of(name: str, ends: list[DdsEndpoint], find: FindType, problems: list[str]) -> tuple[str, Catalogue] | None:
    types = sorted({end.type_name for end in ends})
    hashes = sorted({end.type_hash for end in ends} - {""})
    if types == [""]:
        problems.append(f"{name}: its type on DDS is none of ROS 2")
        return None
    if len(types) > 1 or len(hashes) > 1:
        problems.append(f"{name}: its ends on DDS do not agree: {', '.join(types if len(types) > 1 else hashes)}")
        return None
    hash_text = hashes[0] if hashes else ""
    catalogue = find(types[0], hash_text)
    if catalogue is None:
        problems.append(
            f"{name}: {types[0]} {hash_text}".rstrip() + " is in no catalogue here (METAROS_INTERFACE_PATH)"
        )
        return None
    return types[0], catalogue
