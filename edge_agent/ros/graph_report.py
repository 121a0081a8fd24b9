"""Incremental graph reports: what the gateway knows, and the bounded frames that bring it up to date. Pure."""

from __future__ import annotations

from collections.abc import Iterable, Mapping

from edge_agent.ros.graph_snapshot import GraphEndpoint, GraphSnapshot
from metaros._proto import link_pb2
from metaros.limits import LIMITS, Limits
from metaros.link.parse_cost import parse_cost

__all__ = ["GraphReporter"]

FRAME_ITEMS = 256  # nodes and endpoints of one frame, so that it is well below what a lane takes at a time


class GraphReporter:
    """What one link was sent. `changes` gives the frames that lead from there to the present graph."""

    def __init__(self, *, limits: Limits = LIMITS) -> None:
        self._limits = limits
        self.begin()

    def begin(self) -> None:
        """Another link: nothing was sent yet."""
        self._anew = True
        self._revision = self._left_out = self._last = 0
        self._nodes: frozenset[str] = frozenset()
        self._numbers: dict[bytes, int] = {}
        self._endpoints: dict[bytes, GraphEndpoint] = {}
        self._types: set[tuple[str, str]] = set()

    def changes(
        self, now: GraphSnapshot, types: Mapping[tuple[str, str], link_pb2.TypeText] | None = None
    ) -> list[link_pb2.GraphReport]:
        """The frames for what is now; none where nothing changed. `types` are the texts that are known by now."""
        room = max(0, self._limits.graph_entities - len(now.nodes))
        nodes = frozenset(sorted(now.nodes)[: self._limits.graph_entities])
        endpoints = dict(list(now.endpoints.items())[:room])
        left_out = len(now.nodes) + len(now.endpoints) - len(nodes) - len(endpoints)
        gone = [gid for gid, endpoint in self._endpoints.items() if endpoints.get(gid) != endpoint]
        came = [gid for gid, endpoint in endpoints.items() if self._endpoints.get(gid) != endpoint]
        texts = [text for key, text in (types or {}).items() if key not in self._types]
        changed = gone or came or texts or nodes != self._nodes or left_out != self._left_out
        if not (changed or self._anew):
            return []
        frames = [self._frame()]
        frames[0].endpoints_gone.extend(self._numbers.pop(gid) for gid in gone)
        self._add(frames, "nodes_gone", sorted(self._nodes - nodes))
        self._add(frames, "nodes", sorted(nodes - self._nodes))
        self._add(frames, "endpoints", [self._endpoint(gid, endpoints[gid]) for gid in came])
        self._add_types(frames, texts)
        self._types.update((text.type_name, text.type_hash) for text in texts)
        self._nodes, self._endpoints, self._left_out = nodes, endpoints, left_out
        self._revision += 1
        for frame in frames:
            frame.revision, frame.left_out, frame.more = self._revision, left_out, frame is not frames[-1]
        frames[0].anew, self._anew = self._anew, False
        return frames

    def _endpoint(self, gid: bytes, endpoint: GraphEndpoint) -> link_pb2.GraphEndpoint:
        self._last += 1
        self._numbers[gid] = self._last
        kind, node, name, type_name, type_hash, qos = endpoint
        return link_pb2.GraphEndpoint(
            number=self._last,
            kind=kind,  # type: ignore[arg-type]  # a number of the enum
            node=node,
            name=name,
            type_name=type_name,
            type_hash=type_hash,
            qos=qos,
        )

    @staticmethod
    def _frame() -> link_pb2.GraphReport:
        return link_pb2.GraphReport()

    def _add(self, frames: list[link_pb2.GraphReport], field: str, items: Iterable[object]) -> None:
        """Put items into the last frame, and into further ones as it fills."""
        for item in items:
            last = frames[-1]
            if len(last.nodes) + len(last.nodes_gone) + len(last.endpoints) >= FRAME_ITEMS:
                last = self._frame()
                frames.append(last)
            getattr(last, field).append(item)

    def _add_types(self, frames: list[link_pb2.GraphReport], texts: Iterable[link_pb2.TypeText]) -> None:
        """As many to a frame as a gateway reads of one."""
        taken = 0
        for text in texts:
            steps = parse_cost(text, enough=self._limits.graph_type_steps)
            taken += steps
            if taken > self._limits.graph_type_steps and frames[-1].types:
                frames.append(self._frame())
                taken = steps
            self._add(frames, "types", [text])
