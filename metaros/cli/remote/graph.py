"""A remote robot's graph as commands read it: REST's answer as liveliness tokens."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from typing import Any

from metaros.wire import EndpointInfo, NodeInfo, QoSProfile
from metaros.wire.graph import GraphState
from metaros.wire.liveliness_tokens import EndpointKind, EndpointToken, NodeToken
from metaros.wire.names import NO_HASH

__all__ = ["RemoteGraph"]

FIRST_ENDPOINT = 1_000_000  # numbers of endpoints; those of nodes are below
_ZID = "0" * 32  # whose session it is stays on the robot
# List of the document, its key, and which of its lists are which kind of endpoint.
_PARTS: tuple[tuple[str, str, tuple[tuple[str, EndpointKind], ...]], ...] = (
    ("topics", "topic", (("publishers", "MP"), ("subscribers", "MS"))),
    ("services", "service", (("servers", "SS"), ("clients", "SC"))),
)
_ACTION_KINDS: tuple[tuple[str, EndpointKind], ...] = (("servers", "SS"), ("clients", "SC"))
_ELSEWHERE = "/_elsewhere"  # who is no node of the robot's namespace is told without a name


class RemoteGraph:
    """A snapshot: unlike `metaros.wire.Graph` it does not follow changes."""

    def __init__(self, document: Mapping[str, Any]) -> None:
        self._state = GraphState()
        self._nodes: dict[str, NodeToken] = {}
        self._count = FIRST_ENDPOINT
        for name in document["nodes"]:
            self._node(str(name))
        for part, key, kinds in _PARTS:
            for item in document[part]:
                for where, kind in kinds:
                    for end in item.get(where, ()):
                        self._add(str(item[key]), kind, end["node"], end["type"], end["type_hash"], end["qos"])
        for action in document["actions"]:  # told as one; of its five endpoints the service that takes goals says all
            for where, kind in _ACTION_KINDS:
                for node in action[where]:
                    self._add(f"{action['action']}/_action/send_goal", kind, node, f"{action['type']}_SendGoal")

    def nodes(self) -> list[NodeInfo]:
        """Every node, by name."""
        return self._state.nodes()

    def endpoints(self, topic: str | None = None, kind: str | None = None) -> list[EndpointInfo]:
        """Every endpoint, or those of one topic (or service), one kind."""
        return self._state.endpoints(topic, kind)

    def tokens(self, topic: str | None = None) -> list[EndpointToken]:
        """Every endpoint's token, or those of one topic (or service)."""
        return self._state.tokens(topic)

    def topics(self) -> dict[str, set[str]]:
        """The type names on every topic."""
        return _types(item for item in self.endpoints() if item.kind in ("MP", "MS"))

    def services(self) -> dict[str, set[str]]:
        """The type names of every service."""
        return _types(item for item in self.endpoints() if item.kind in ("SS", "SC"))

    def wait_for(self, condition: Callable[[], bool], timeout_s: float) -> bool:
        """Whether it is so: what was read once does not change."""
        return condition()

    def _node(self, name: str) -> NodeToken:
        if name not in self._nodes:
            namespace, _, own = name.rpartition("/")
            token = self._nodes[name] = NodeToken(0, _ZID, len(self._nodes), own, namespace or "/")
            self._state.add(str(token))
        return self._nodes[name]

    def _add(
        self, name: str, kind: EndpointKind, node: str, type_name: str, type_hash: str = "", qos: str = ""
    ) -> None:
        self._count += 1
        token = EndpointToken(
            self._node(node or _ELSEWHERE),
            self._count,
            kind,
            name,
            type_name,
            type_hash or NO_HASH,
            qos or QoSProfile().encode(),
        )
        self._state.add(str(token))


def _types(infos: Iterable[EndpointInfo]) -> dict[str, set[str]]:
    found: dict[str, set[str]] = {}
    for info in infos:
        found.setdefault(info.topic, set()).add(info.type_name)
    return dict(sorted(found.items()))
