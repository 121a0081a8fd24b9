"""Which names of the ROS graph are this agent's: its namespace, minus the excluded patterns. Pure."""

from __future__ import annotations

from collections.abc import Iterable

from metaros.idl.globs import Glob

__all__ = ["ROSOUT", "Scope"]

ROSOUT = "/rosout"


class Scope:
    """Several agents may share one Zenoh graph; each taps, and commands, only what is in its scope."""

    def __init__(self, namespace: str = "/", exclude: Iterable[str] = ()) -> None:
        self.namespace = namespace
        self._prefix = namespace.rstrip("/") + "/"
        self._exclude = tuple(Glob(pattern) for pattern in exclude)

    def includes(self, name: str) -> bool:
        """Whether a topic, a service or a node's full name is in scope."""
        return name.startswith(self._prefix) and not any(glob.matches(name) for glob in self._exclude)

    def taps(self, topic: str) -> bool:
        """Whether a topic is tapped: those in scope, and /rosout, whose samples are then sorted by their sender.

        What is hidden at the root (`/_…`) is no robot's: tools talk to themselves there.
        """
        return topic == ROSOUT or (self.includes(topic) and not topic.startswith("/_"))
