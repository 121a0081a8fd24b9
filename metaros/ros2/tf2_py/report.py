"""The tree in words: a list of its edges, YAML as `view_frames` reads it, and a drawing for Graphviz."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import NamedTuple

from metaros.ros2.tf2_py.caches import Cache, seconds
from metaros.ros2.tf2_py.walk import Frames

__all__ = ["as_dot", "as_string", "as_yaml"]

_NOBODY = "no recorded authority"
_SHORTEST_NS = 100_000  # one sample has no rate; tf2 takes this as the time it is spread over


class _Edge(NamedTuple):
    child: str
    parent: str
    authority: str
    rate_hz: float
    oldest_ns: int
    newest_ns: int

    @property
    def length_s(self) -> float:
        return (self.newest_ns - self.oldest_ns) / 1e9


def as_string(frames: Frames) -> str:
    """One line a frame that has a parent, or had one."""
    lines = []
    for child, cache in frames.items():
        if cache is not None:
            latest = cache.latest()
            lines.append(f"Frame {child} exists with parent {'NO_PARENT' if latest is None else latest[1]}.\n")
    return "".join(lines)


def as_yaml(frames: Frames, authorities: Mapping[str, str], now_ns: int = 0) -> str:
    """A mapping of frames; `[]` if there are none. Times are in seconds, rates a second."""
    if not frames:
        return "[]"
    lines = []
    for edge in _edges(frames, authorities):
        lines += [
            f"{edge.child}: ",
            f"  parent: '{edge.parent}'",
            f"  broadcaster: '{edge.authority}'",
            f"  rate: {edge.rate_hz:.3f}",
            f"  most_recent_transform: {seconds(edge.newest_ns)}",
            f"  oldest_transform: {seconds(edge.oldest_ns)}",
        ]
        if now_ns:
            lines.append(f"  transform_delay: {(now_ns - edge.newest_ns) / 1e9:.3f}")
        lines.append(f"  buffer_length: {edge.length_s:.3f}")
    return "".join(f"{line}\n" for line in lines)


def as_dot(frames: Frames, authorities: Mapping[str, str], now_ns: int = 0) -> str:
    """A directed graph from parents to children."""
    lines = ["digraph G {"]
    edges = list(_edges(frames, authorities))
    if not edges:
        lines.append('"no tf data received"')
    for edge in edges:
        age = f"( {(now_ns - edge.newest_ns) / 1e9:.3f} sec old)" if now_ns else ""
        label = (
            rf"Broadcaster: {edge.authority}\n"
            rf"Average rate: {edge.rate_hz:.3f} Hz\n"
            rf"Most recent transform: {seconds(edge.newest_ns)} {age}\n"
            rf"Buffer length: {edge.length_s:.3f} sec\n"
        )
        lines.append(f'"{edge.parent}" -> "{edge.child}"[label="{label}"];')
    if now_ns:
        children = {edge.child for edge in edges}
        lines.append("edge [style=invis];")
        lines.append('subgraph cluster_legend { style=bold; color=black; label="view_frames Result";')
        lines.append(f'"Recorded at time: {seconds(now_ns)}"[ shape=plaintext ];')
        lines += [f'}} -> "{frame}";' for frame in frames if frame not in children][:1] or ["}"]
    return "\n".join([*lines, "}"])


def _edges(frames: Frames, authorities: Mapping[str, str]) -> Iterator[_Edge]:
    for child, cache in frames.items():
        latest = None if cache is None else cache.latest()
        if cache is None or latest is None:
            continue
        yield _Edge(child, latest[1], authorities.get(child, _NOBODY), _rate_hz(cache), *cache.span_ns())


def _rate_hz(cache: Cache) -> float:
    oldest_ns, newest_ns = cache.span_ns()
    return len(cache) * 1e9 / max(newest_ns - oldest_ns, _SHORTEST_NS)
