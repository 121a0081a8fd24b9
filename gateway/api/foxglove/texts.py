"""What the server sends a Foxglove client in JSON: one function an `op`. Pure."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import orjson

from gateway.api.foxglove.requests import Parameter

__all__ = [
    "CAPABILITIES",
    "ENCODINGS",
    "ERROR",
    "INFO",
    "WARNING",
    "GraphView",
    "ServiceView",
    "advertise",
    "advertise_services",
    "channel_view",
    "graph_update",
    "parameter_values",
    "remove_status",
    "server_info",
    "service_failure",
    "status",
    "unadvertise",
    "unadvertise_services",
]

INFO, WARNING, ERROR = 0, 1, 2
CAPABILITIES = (
    "clientPublish",
    "parameters",
    "parametersSubscribe",
    "time",
    "services",
    "connectionGraph",
    "assets",
    "playbackControl",
)
ENCODINGS = ("json", "cdr")  # that a client may publish and call in
_SECOND_NS = 10**9

Graph = Mapping[str, Sequence[str]]


@dataclass(frozen=True, slots=True)
class ServiceView:
    """A service as viewers list it; the schemas are ros2msg texts."""

    id: int
    name: str
    type_name: str
    request: str
    response: str


@dataclass(frozen=True, slots=True)
class GraphView:
    """Who publishes and subscribes which topics, and provides which services."""

    published: Graph
    subscribed: Graph
    services: Graph


def server_info(
    name: str, *, session: str, metadata: Mapping[str, str], span_ns: tuple[int, int] | None, assets: bool
) -> str:
    """The first message. `span_ns`: from when to when there is history to play; None: there is none."""
    absent = {"playbackControl": span_ns is None, "assets": not assets}
    info: dict[str, Any] = {
        "op": "serverInfo",
        "name": name,
        "capabilities": [item for item in CAPABILITIES if not absent.get(item, False)],
        "supportedEncodings": list(ENCODINGS),
        "metadata": dict(metadata),
        "sessionId": session,
    }
    if span_ns is not None:
        info |= {"dataStartTime": _time(span_ns[0]), "dataEndTime": _time(span_ns[1])}
    return _json(info)


def status(level: int, message: str, *, note_id: str = "") -> str:
    """A note to the user; one with an id takes the place of the one before with it."""
    return _json({"op": "status", "level": level, "message": message, **({"id": note_id} if note_id else {})})


def remove_status(*ids: str) -> str:
    """These notes do not hold any more."""
    return _json({"op": "removeStatus", "statusIds": list(ids)})


def channel_view(
    number: int,
    *,
    topic: str,
    encoding: str,
    schema_name: str,
    schema_encoding: str,
    schema: str,
    metadata: Graph | None,
) -> dict[str, Any]:
    """A channel as `advertise` lists it."""
    return {
        "id": number,
        "topic": topic,
        "encoding": encoding,
        "schemaName": schema_name,
        "schemaEncoding": schema_encoding,
        "schema": schema,
        **({"metadata": metadata} if metadata else {}),
    }


def advertise(channels: Sequence[Mapping[str, Any]]) -> str:
    """These channels can be subscribed."""
    return _json({"op": "advertise", "channels": list(channels)})


def unadvertise(numbers: Iterable[int]) -> str:
    """These channels are gone."""
    return _json({"op": "unadvertise", "channelIds": sorted(numbers)})


def advertise_services(services: Iterable[ServiceView]) -> str:
    """These services can be called."""
    return _json({"op": "advertiseServices", "services": [_service(item) for item in services]})


def unadvertise_services(numbers: Iterable[int]) -> str:
    """These services are gone."""
    return _json({"op": "unadvertiseServices", "serviceIds": sorted(numbers)})


def service_failure(service_id: int, call_id: int, message: str) -> str:
    """A call that has no answer."""
    return _json({"op": "serviceCallFailure", "serviceId": service_id, "callId": call_id, "message": message})


def parameter_values(parameters: Iterable[Parameter], *, answer_to: str | None = None) -> str:
    """The values of parameters: an answer where there is an id, else news."""
    views = [
        {"name": item.name, "value": item.value, **({"type": item.type} if item.type else {})}
        if item.value is not None
        else {"name": item.name}
        for item in parameters
    ]
    return _json({"op": "parameterValues", "parameters": views, **({"id": answer_to} if answer_to is not None else {})})


def graph_update(before: GraphView | None, after: GraphView) -> str | None:
    """What changed between two graphs, all of it the first time; None where nothing did."""
    old = before if before is not None else GraphView({}, {}, {})
    topics = {*old.published, *old.subscribed} - {*after.published, *after.subscribed}
    update: dict[str, list[Any]] = {
        "publishedTopics": _changed(old.published, after.published, "publisherIds", gone=topics),
        "subscribedTopics": _changed(old.subscribed, after.subscribed, "subscriberIds", gone=topics),
        "advertisedServices": _changed(old.services, after.services, "providerIds", gone=set(old.services)),
        "removedTopics": sorted(topics),
        "removedServices": sorted(set(old.services) - set(after.services)),
    }
    if before is not None and not any(update.values()):
        return None
    return _json({"op": "connectionGraphUpdate", **update})


def _changed(before: Graph, after: Graph, ids: str, *, gone: set[str]) -> list[dict[str, Any]]:
    """Entries that are new or other; one that lost its last end but whose topic lives is told as empty."""
    found = [{"name": name, ids: list(ends)} for name, ends in sorted(after.items()) if before.get(name) != ends]
    emptied = sorted(name for name in before if name not in after and name not in gone)
    return [*found, *({"name": name, ids: []} for name in emptied)]


def _service(item: ServiceView) -> dict[str, Any]:
    """Exactly one form of schema on each side: `request`, not the older `requestSchema`."""
    name = {"encoding": "cdr", "schemaEncoding": "ros2msg"}
    return {
        "id": item.id,
        "name": item.name,
        "type": item.type_name,
        "request": {**name, "schemaName": f"{item.type_name}_Request", "schema": item.request},
        "response": {**name, "schemaName": f"{item.type_name}_Response", "schema": item.response},
    }


def _time(stamp_ns: int) -> dict[str, int]:
    seconds, rest = divmod(max(0, stamp_ns), _SECOND_NS)
    return {"sec": seconds, "nsec": rest}


def _json(message: Mapping[str, Any]) -> str:
    return orjson.dumps(message).decode()
