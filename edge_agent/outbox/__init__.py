"""The outbox: samples that the gateway was promised, on the robot's disk until it has them."""

from __future__ import annotations

from edge_agent.outbox.classes import BACKFILL_BIT, CLASSES, LOGS, ClassPolicy, log_name
from edge_agent.outbox.disk import Disk, OsDisk
from edge_agent.outbox.log import Taken
from edge_agent.outbox.outbox import Depth, Outbox, StreamRange
from edge_agent.outbox.segment import Frame, Gap, Kind
from edge_agent.outbox.writer import OutboxWriter, run_steps, steps

__all__ = [
    "BACKFILL_BIT",
    "CLASSES",
    "LOGS",
    "ClassPolicy",
    "Depth",
    "Disk",
    "Frame",
    "Gap",
    "Kind",
    "OsDisk",
    "Outbox",
    "OutboxWriter",
    "StreamRange",
    "Taken",
    "log_name",
    "run_steps",
    "steps",
]
