"""The outbox: samples that the gateway was promised, on the robot's disk until it has them."""

from __future__ import annotations

from edge_agent.outbox.classes import CLASSES, LOGS, ClassPolicy, log_name
from edge_agent.outbox.disk import Disk, OsDisk
from edge_agent.outbox.ids import ChannelId, IdLog, SeriesId
from edge_agent.outbox.log import Taken
from edge_agent.outbox.outbox import Depth, Outbox, StreamRange
from edge_agent.outbox.segment import Frame, Gap, Kind
from edge_agent.outbox.series_use import forget_series
from edge_agent.outbox.writer import OutboxWriter, run_steps, steps

__all__ = [
    "CLASSES",
    "LOGS",
    "ChannelId",
    "ClassPolicy",
    "Depth",
    "Disk",
    "Frame",
    "Gap",
    "IdLog",
    "Kind",
    "OsDisk",
    "Outbox",
    "OutboxWriter",
    "SeriesId",
    "StreamRange",
    "Taken",
    "forget_series",
    "log_name",
    "run_steps",
    "steps",
]
