"""A robot's other nodes with their parameters and lifecycles, as `edge_agent.twin.services` asks for them; no wire."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Any

from metaros.errors import UnavailableError
from metaros.node.parameters import SetResult

__all__ = ["STEPS", "RosNodes"]

STEPS = {1: "inactive", 2: "unconfigured", 3: "active", 4: "inactive", 5: "finalized", 6: "finalized", 7: "finalized"}


class RosNodes:
    """Nodes below a namespace. `refuses` names parameters that they do not take, `silent` nodes that do not answer."""

    def __init__(self, namespace: str = "/r", /, **nodes: dict[str, Any]) -> None:
        self.nodes = {f"{namespace}/{name}": dict(values) for name, values in nodes.items()}
        self.life = dict.fromkeys(self.nodes, "1")
        self.refuses: set[str] = set()
        self.silent: set[str] = set()
        self.states = dict.fromkeys(self.nodes, "unconfigured")
        self.stuck: set[int] = set()
        self.sets: list[tuple[str, dict[str, Any]]] = []
        self.told: list[Callable[[], None]] = []

    def lives(self) -> dict[str, str]:
        """See NodeServices."""
        return dict(self.life)

    def on_change(self, callback: Callable[[], None]) -> Callable[[], None]:
        """See NodeServices."""
        self.told.append(callback)
        return lambda: self.told.remove(callback)

    def changed(self) -> None:
        """Nodes came or went."""
        for callback in list(self.told):
            callback()

    def start(self, name: str, life: str, **values: Any) -> None:
        """A node's process begins, with the values of its own start."""
        self.nodes[name], self.life[name], self.states[name] = values, life, "unconfigured"
        self.changed()

    async def get(self, node: str, names: Sequence[str]) -> dict[str, Any]:
        """See NodeServices."""
        self.answer(node)
        return {name: self.nodes[node].get(name) for name in names}

    async def set(self, node: str, values: Mapping[str, Any]) -> Mapping[str, SetResult]:
        """See NodeServices."""
        self.answer(node)
        self.sets.append((node, dict(values)))
        taken = {name: value for name, value in values.items() if name not in self.refuses}
        for name, value in taken.items():
            if value is None:
                self.nodes[node].pop(name, None)
            else:
                self.nodes[node][name] = value
        return {name: SetResult(name in taken, "" if name in taken else "too much") for name in values}

    async def state(self, node: str) -> str:
        """See NodeServices."""
        self.answer(node)
        return self.states[node]

    async def change(self, node: str, transition: int) -> bool:
        """See NodeServices."""
        if transition in self.stuck:
            return False
        self.states[node] = STEPS[transition]
        return True

    def answer(self, node: str) -> None:
        """Called before a node answers; UnavailableError where it does not."""
        if node in self.silent:
            raise UnavailableError(f"{node} does not answer")
