"""Wires recordings to the registry, the links and the command dispatcher."""

from __future__ import annotations

import contextlib

from gateway.errors import RobotOfflineError
from gateway.fleet.command_dispatcher import CommandDispatcher
from gateway.history.recordings.manager import RobotLink
from gateway.ingest.links import Links
from gateway.ingest.registry import Registry
from metaros._proto import link_pb2

__all__ = ["robot_link"]


def robot_link(registry: Registry, links: Links, commands: CommandDispatcher) -> RobotLink:
    """The interface of recordings to robots: requests, messages, and which are online."""

    def send(robot_id: str, wanted: link_pb2.RecordingWanted) -> None:
        with contextlib.suppress(RobotOfflineError):
            frame = link_pb2.GatewayFrame(recording_wanted=wanted)
            links.send(robot_id, frame, lane=link_pb2.LANE_BACKFILL)

    def offset_ns(robot_id: str) -> int:
        record = registry.find(robot_id)
        return record.statistics.link.clock_offset_ns if record is not None else 0

    def online(robot_id: str) -> bool:
        record = registry.find(robot_id)
        return record is not None and record.here

    return RobotLink(command=commands.run, send=send, online=online, clock_offset_ns=offset_ns)
