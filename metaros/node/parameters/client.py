"""Another node's parameters, through its six services: blocking, and as coroutines."""

from __future__ import annotations

import threading
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Final, Generic, Protocol, TypeVar

from metaros.errors import ParameterError, PeerError
from metaros.idl import message_class
from metaros.node.client import Client
from metaros.node.parameters.descriptor import ParameterDescriptor
from metaros.node.parameters.services import SERVICES
from metaros.node.parameters.values import ParameterType, Value, infer
from metaros.wire import Graph, QoSProfile, qos_parameters

__all__ = ["ParameterClient", "SetResult"]

T = TypeVar("T")
Names = list[str]
DEFAULT_TIMEOUT_S: Final = 10.0


@dataclass(frozen=True, slots=True)
class SetResult:
    """What a node said to a set. True when it was done."""

    successful: bool
    reason: str = ""

    def __bool__(self) -> bool:
        return self.successful


@dataclass(frozen=True, slots=True)
class _Call(Generic[T]):
    """A request to one of the services, and how to read its response."""

    service: str
    request: Mapping[str, Any]
    read: Callable[[Any], T]


class CallingNode(Protocol):
    """What a parameter client needs of a node; the command line has one that calls by a gateway, too."""

    @property
    def graph(self) -> Graph:
        """Who else is there."""

    def resolve(self, name: str) -> str:
        """The full name."""

    def create_client(self, service_type: type[Any], name: str, qos: QoSProfile) -> Client:
        """A client of one of the services."""


class ParameterClient:
    """Reads and sets the parameters of the node `target`. Every method has an `…_async` twin for coroutines.

    Errors are those of `Client.call`: `unavailable` at once without the node, `timeout` without an answer.
    Values are sent as what they are: a remote double takes 1.0, not 1.
    """

    def __init__(self, node: CallingNode, target: str) -> None:
        self._node = node
        self.target = node.resolve(target)
        self._clients: dict[str, Client] = {}
        self._lock = threading.Lock()

    def wait(self, timeout_s: float = DEFAULT_TIMEOUT_S) -> bool:
        """Wait until all six services of the node are there; False when they are not in time."""
        graph, names = self._node.graph, [f"{self.target}/{service.name}" for service in SERVICES]
        return graph.wait_for(lambda: all(graph.endpoints(name, "SS") for name in names), timeout_s)

    def get(self, names: Sequence[str], *, timeout_s: float = DEFAULT_TIMEOUT_S) -> dict[str, Value]:
        """Values by name; None for what is not declared or has no value."""
        return self._call(_get(names), timeout_s)

    async def get_async(self, names: Sequence[str], *, timeout_s: float = DEFAULT_TIMEOUT_S) -> dict[str, Value]:
        """As `get`."""
        return await self._call_async(_get(names), timeout_s)

    def types(self, names: Sequence[str], *, timeout_s: float = DEFAULT_TIMEOUT_S) -> dict[str, ParameterType]:
        """Types by name; NOT_SET for what is not declared or has no value."""
        return self._call(_types(names), timeout_s)

    async def types_async(
        self, names: Sequence[str], *, timeout_s: float = DEFAULT_TIMEOUT_S
    ) -> dict[str, ParameterType]:
        """As `types`."""
        return await self._call_async(_types(names), timeout_s)

    def list(self, prefixes: Sequence[str] = (), depth: int = 0, *, timeout_s: float = DEFAULT_TIMEOUT_S) -> Names:
        """Names, or those below the prefixes, at most `depth` levels deep (0: any)."""
        return self._call(_list(prefixes, depth), timeout_s)

    async def list_async(
        self, prefixes: Sequence[str] = (), depth: int = 0, *, timeout_s: float = DEFAULT_TIMEOUT_S
    ) -> Names:
        """As `list`."""
        return await self._call_async(_list(prefixes, depth), timeout_s)

    def describe(self, names: Sequence[str], *, timeout_s: float = DEFAULT_TIMEOUT_S) -> dict[str, ParameterDescriptor]:
        """Types and rules by name; names that are not declared are left out."""
        return self._call(_describe(names), timeout_s)

    async def describe_async(
        self, names: Sequence[str], *, timeout_s: float = DEFAULT_TIMEOUT_S
    ) -> dict[str, ParameterDescriptor]:
        """As `describe`."""
        return await self._call_async(_describe(names), timeout_s)

    def set(self, values: Mapping[str, Any], *, timeout_s: float = DEFAULT_TIMEOUT_S) -> dict[str, SetResult]:
        """Set each for itself; None deletes one that is dynamically typed."""
        return self._call(_set(values), timeout_s)

    async def set_async(
        self, values: Mapping[str, Any], *, timeout_s: float = DEFAULT_TIMEOUT_S
    ) -> dict[str, SetResult]:
        """As `set`."""
        return await self._call_async(_set(values), timeout_s)

    def set_atomically(self, values: Mapping[str, Any], *, timeout_s: float = DEFAULT_TIMEOUT_S) -> SetResult:
        """Set all or none."""
        return self._call(_set_atomically(values), timeout_s)

    async def set_atomically_async(
        self, values: Mapping[str, Any], *, timeout_s: float = DEFAULT_TIMEOUT_S
    ) -> SetResult:
        """As `set_atomically`."""
        return await self._call_async(_set_atomically(values), timeout_s)

    def dump(self, *, timeout_s: float = DEFAULT_TIMEOUT_S) -> dict[str, Value]:
        """All values by name."""
        return self.get(self.list(timeout_s=timeout_s), timeout_s=timeout_s)

    async def dump_async(self, *, timeout_s: float = DEFAULT_TIMEOUT_S) -> dict[str, Value]:
        """As `dump`."""
        return await self.get_async(await self.list_async(timeout_s=timeout_s), timeout_s=timeout_s)

    def close(self) -> None:
        """Close the clients; the node's own close does it, too."""
        with self._lock:
            clients, self._clients = self._clients, {}
        for client in clients.values():
            client.close()

    def _call(self, call: _Call[T], timeout_s: float) -> T:
        client = self._client(call.service)
        return call.read(client.call(client.service_type.Request(**call.request), timeout_s=timeout_s))

    async def _call_async(self, call: _Call[T], timeout_s: float) -> T:
        client = self._client(call.service)
        return call.read(await client.call_async(client.service_type.Request(**call.request), timeout_s=timeout_s))

    def _client(self, service: str) -> Client:
        """The client of a service, made at its first use."""
        with self._lock:
            client = self._clients.get(service)
            if client is None:
                name = "".join(f"_{letter.lower()}" if letter.isupper() else letter for letter in service)
                kind = message_class(f"rcl_interfaces/srv/{service}")
                client = self._node.create_client(kind, f"{self.target}/{name[1:]}", qos_parameters)
                self._clients[service] = client
            return client


def _get(names: Sequence[str]) -> _Call[dict[str, Value]]:
    from metaros.node.parameters.wire import read_value

    def read(response: Any) -> dict[str, Value]:
        if not response.values:  # what rclcpp says when one of the names is unknown
            return dict.fromkeys(names)
        return dict(zip(names, map(read_value, _counted(response.values, names)), strict=True))

    return _Call("GetParameters", {"names": list(names)}, read)


def _types(names: Sequence[str]) -> _Call[dict[str, ParameterType]]:
    known = {int(kind) for kind in ParameterType}

    def read(response: Any) -> dict[str, ParameterType]:
        types = [int(kind) for kind in response.types] or [0] * len(names)
        kinds = [ParameterType(kind if kind in known else 0) for kind in _counted(types, names)]
        return dict(zip(names, kinds, strict=True))

    return _Call("GetParameterTypes", {"names": list(names)}, read)


def _list(prefixes: Sequence[str], depth: int) -> _Call[Names]:
    return _Call(
        "ListParameters", {"prefixes": list(prefixes), "depth": depth}, lambda response: list(response.result.names)
    )


def _describe(names: Sequence[str]) -> _Call[dict[str, ParameterDescriptor]]:
    from metaros.node.parameters.wire import read_descriptor

    def read(response: Any) -> dict[str, ParameterDescriptor]:
        try:
            found = [read_descriptor(descriptor) for descriptor in response.descriptors]
        except ParameterError as error:
            raise PeerError(f"a descriptor contradicts itself: {error}") from None
        return {descriptor.name: descriptor for descriptor in found if descriptor is not None}

    return _Call("DescribeParameters", {"names": list(names)}, read)


def _parameters(values: Mapping[str, Any]) -> list[Any]:
    from metaros.node.parameters.wire import parameter_message

    return [parameter_message(name, infer(value)) for name, value in values.items()]


def _set(values: Mapping[str, Any]) -> _Call[dict[str, SetResult]]:
    names = list(values)

    def read(response: Any) -> dict[str, SetResult]:
        results = _counted(response.results, names)
        return {name: SetResult(item.successful, item.reason) for name, item in zip(names, results, strict=True)}

    return _Call("SetParameters", {"parameters": _parameters(values)}, read)


def _set_atomically(values: Mapping[str, Any]) -> _Call[SetResult]:
    return _Call(
        "SetParametersAtomically",
        {"parameters": _parameters(values)},
        lambda response: SetResult(response.result.successful, response.result.reason),
    )


def _counted(items: Sequence[Any], names: Sequence[str]) -> Sequence[Any]:
    """One item a name, or the node's answer is wrong."""
    if len(items) != len(names):
        raise PeerError(f"{len(items)} answers to {len(names)} names")
    return items
