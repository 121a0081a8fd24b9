"""What an uplink sends from: the parts of the agent in which data waits for the link."""

from __future__ import annotations

from dataclasses import dataclass

from edge_agent.blackbox.recording_store import RecordingStore
from edge_agent.forwarding.channels import Channels
from edge_agent.forwarding.live_batch import Linger
from edge_agent.forwarding.live_queue import LiveQueue
from edge_agent.forwarding.sample_trace import Tracer
from edge_agent.link.budget import Budget
from edge_agent.outbox import Outbox

__all__ = ["Queues"]


@dataclass(frozen=True, slots=True)
class Queues:
    """What is known of the robot's topics, what of them waits for the link, and how much of it may go."""

    channels: Channels
    outbox: Outbox
    live: LiveQueue
    linger: Linger
    budget: Budget
    recordings: RecordingStore | None = None  # recordings that wait
    tracer: Tracer | None = None
