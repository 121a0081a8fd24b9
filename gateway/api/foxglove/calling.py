"""A Foxglove client's calls of robots' services, in JSON or CDR as it likes."""

from __future__ import annotations

from collections.abc import Iterable

import orjson

from gateway.api.foxglove.binary import ServiceCall, service_response
from gateway.api.foxglove.texts import ENCODINGS, ServiceView, service_failure
from gateway.api.robot_access import RobotAccess
from gateway.domain.client_names import ClientNames
from gateway.errors import InvalidRequestError
from gateway.fleet.ros.graph import RobotGraph
from metaros.errors import MetarosError
from metaros.limits import LIMITS

__all__ = ["KnownServices", "answer_call"]

Known = tuple[str, str, str, str]


class KnownServices:
    """The services of one client's robots; a robot's are read again when its graph is another one."""

    def __init__(self) -> None:
        self._read: dict[str, tuple[RobotGraph, list[Known]]] = {}

    def of(self, graphs: Iterable[RobotGraph], names: ClientNames) -> list[Known]:
        """(shown name, type, request's schema, response's) of each service whose type the gateway knows."""
        before, self._read = self._read, {}
        found: list[Known] = []
        for graph in graphs:
            read = before.get(graph.robot)
            if graph.services:
                if read is None or read[0] is not graph:
                    read = (graph, _known_services(graph, names))
                self._read[graph.robot] = read
                found += read[1]
        return found


def _known_services(graph: RobotGraph, names: ClientNames) -> list[Known]:
    found = []
    for name, info in graph.services.items():
        if not info.servers:
            continue
        request = graph.schema(f"{info.type_name}_Request", info.type_hash)
        response = graph.schema(f"{info.type_name}_Response", info.type_hash)
        if request or response:
            found.append((names.shown(graph.robot, name), info.type_name, request, response))
    return found


async def answer_call(
    access: RobotAccess, view: ServiceView | None, call: ServiceCall, *, lease_id: str
) -> bytes | str:
    """What to send back: a binary answer, or the text of a failure. Raises nothing of ours."""
    try:
        if view is None:
            raise InvalidRequestError(f"Unknown service ID: {call.service_id}")
        if call.encoding not in ENCODINGS:
            raise InvalidRequestError(f"encoding {call.encoding[:20]!r}: calls are {' or '.join(ENCODINGS)}")
        timeout_s = LIMITS.command_timeout_s
        if call.encoding == "cdr":
            answer: bytes = await access.call(
                view.name, type_name=view.type_name, cdr=call.payload, raw=True, timeout_s=timeout_s, lease_id=lease_id
            )
        else:
            values = await access.call(
                view.name,
                type_name=view.type_name,
                request=_request(call.payload),
                timeout_s=timeout_s,
                lease_id=lease_id,
            )
            answer = orjson.dumps(values)
        return service_response(call.service_id, call.call_id, call.encoding, answer)
    except MetarosError as error:
        return service_failure(call.service_id, call.call_id, str(error)[:500])


def _request(payload: bytes) -> object:
    try:
        return orjson.loads(payload) if payload else {}
    except orjson.JSONDecodeError as error:
        raise InvalidRequestError(f"no JSON: {error}") from None
