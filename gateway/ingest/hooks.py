"""Callbacks by which links pass robots' frames on; `wiring/gateway.py` connects them to the other features."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from gateway.domain.sample import Run
from metaros._proto import link_pb2

__all__ = ["LinkHooks"]


@dataclass(frozen=True, slots=True, kw_only=True)
class LinkHooks:
    """Called on the event loop, one callback a kind of frame."""

    on_samples: Callable[[Run], None]
    on_values: Callable[[str, dict[str, tuple[int, float]]], None]
    on_channels: Callable[[str], None]
    on_online: Callable[[str, bool], None]
    on_result: Callable[[str, link_pb2.CommandResult], None]
    on_recording: Callable[[str, link_pb2.RecordingPart], None] = lambda robot, part: None
    on_twin: Callable[[str, link_pb2.TwinReport], None] = lambda robot, report: None
    on_leases: Callable[[str, int], None] = lambda robot, boot_ns: None
    on_ros: Callable[[str, link_pb2.AgentFrame], None] = lambda robot, frame: None
    fetch_token: Callable[[str], str] = lambda robot: ""
