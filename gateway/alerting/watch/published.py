"""Which topics a robot's nodes publish, also those of a node that is dead now: they are what falls silent then."""

from __future__ import annotations

from collections.abc import Iterable, Mapping

__all__ = ["Published"]

MAX_ROBOTS = 4096
MAX_NODES = 256  # of a robot
MAX_TOPICS = 256  # of a node


class Published:
    """What each node was last seen to publish; bounded, whoever was heard of longest ago goes first."""

    def __init__(self) -> None:
        self._revisions: dict[str, int] = {}
        self._topics: dict[str, dict[str, set[str]]] = {}

    def knows(self, robot: str, revision: int) -> bool:
        """Whether that is the graph that was learned last."""
        return self._revisions.get(robot) == revision

    def learn(self, robot: str, revision: int, publishers: Mapping[str, Iterable[str]]) -> None:
        """The robot's graph is so: the nodes that publish each topic. Nodes that are not in it any more stay known."""
        found: dict[str, set[str]] = {}
        for topic, nodes in publishers.items():
            for node in nodes:
                if len(topics := found.setdefault(node, set())) < MAX_TOPICS:
                    topics.add(topic)
        known = self._topics.pop(robot, {})
        for node, topics in found.items():
            known.pop(node, None)
            known[node] = topics
        while len(known) > MAX_NODES:
            del known[next(iter(known))]
        self._topics[robot], self._revisions[robot] = known, revision
        while len(self._topics) > MAX_ROBOTS:
            gone = next(iter(self._topics))
            del self._topics[gone], self._revisions[gone]

    def topics_of(self, robot: str, node: str) -> set[str]:
        """The topics that a node publishes, or did; launch files name nodes without their namespace."""
        tail = f"/{node.rpartition('/')[2]}"
        return {topic for name, of in self._topics.get(robot, {}).items() if name.endswith(tail) for topic in of}
