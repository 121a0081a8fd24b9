"""Checks the form of frames that other features interpret: recordings, twins, leases, the ROS graph."""

from __future__ import annotations

from typing import Final

from gateway.domain.fleet.recording import is_recording_id
from gateway.errors import ProtocolError
from gateway.ingest.events import LeasesAnswered, RecordingArrived, RosReceived, TwinReported
from gateway.ingest.handshake import LANES
from metaros._proto import link_pb2
from metaros.limits import LIMITS, Limits

__all__ = ["ROS_FRAMES", "read_leases", "read_recording", "read_ros", "read_twin"]

CONTROL, _, BACKFILL = LANES
ROS_FRAMES: Final = ("graph", "goals", "offer_states", "asked")
TWIN_STATES: Final = frozenset({"applied", "applying", "confirming", "reverted", "refused"})


def read_recording(lane: int, part: link_pb2.RecordingPart, *, limits: Limits) -> RecordingArrived:
    """A piece of a recording, or the offer of one. Raises ProtocolError."""
    if lane != BACKFILL:
        raise ProtocolError("recordings travel on the back-fill lane")
    if not is_recording_id(part.recording_id) or len(part.sha256) not in (0, 32):
        raise ProtocolError("a part of a recording has a bad id or checksum")
    if len(part.data) > limits.recording_part_bytes:
        raise ProtocolError(f"a part of a recording has at most {limits.recording_part_bytes} bytes")
    return RecordingArrived(part)


def read_twin(lane: int, report: link_pb2.TwinReport, *, limits: Limits) -> TwinReported:
    """What a robot says of itself. Raises ProtocolError."""
    if lane != CONTROL or report.state not in TWIN_STATES or len(report.sha256) not in (0, 32):
        raise ProtocolError("a report of the twin has a bad lane, state or checksum")
    if report.ByteSize() > limits.twin_report_bytes:
        raise ProtocolError(f"a report of the twin has at most {limits.twin_report_bytes} bytes")
    return TwinReported(report)


def read_leases(lane: int, taken: link_pb2.LeasesTaken) -> LeasesAnswered:
    """A moment of the robot's clock. Raises ProtocolError."""
    if lane != CONTROL or taken.boot_ns <= 0:
        raise ProtocolError("an answer to leases has a bad lane or time")
    return LeasesAnswered(taken.boot_ns)


def read_ros(lane: int, frame: link_pb2.AgentFrame) -> RosReceived:
    """Something of the robot's ROS graph. Raises ProtocolError."""
    if lane != CONTROL:
        raise ProtocolError("what is reported of the ROS graph travels on the control lane")
    count = len(frame.goals.events) + len(frame.goals.goal_ids)
    if count > 2 * LIMITS.goals_kept or len(frame.offer_states.states) > 2 * LIMITS.offers:
        raise ProtocolError("a frame tells of more goals or offers than there can be")
    if any(len(event.goal_id) != 16 for event in frame.goals.events):
        raise ProtocolError("a goal has an id of 16 bytes")
    return RosReceived(frame)
