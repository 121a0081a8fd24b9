"""What recordings need of the link, made of the registry, the links and the desk of commands. Part of the wiring."""

from __future__ import annotations

import contextlib

from gateway.errors import RobotOfflineError
from gateway.fleet.commands import CommandDesk
from gateway.ingest.links import Links
from gateway.ingest.registry import Registry
from gateway.recordings.desk import RobotSide
from metaros._proto import link_pb2

__all__ = ["robot_side"]


def robot_side(registry: Registry, links: Links, commands: CommandDesk) -> RobotSide:
    """How recordings ask robots, tell them, and know of them."""

    def tell(robot_id: str, wanted: link_pb2.RecordingWanted) -> None:
        with contextlib.suppress(RobotOfflineError):
            frame = link_pb2.GatewayFrame(recording_wanted=wanted)
            links.send(robot_id, frame, lane=link_pb2.LANE_BACKFILL)

    def offset_ns(robot_id: str) -> int:
        record = registry.find(robot_id)
        return record.statistics.link.clock_offset_ns if record is not None else 0

    def online(robot_id: str) -> bool:
        record = registry.find(robot_id)
        return record is not None and record.here

    return RobotSide(command=commands.run, tell=tell, online=online, clock_offset_ns=offset_ns)
