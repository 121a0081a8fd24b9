"""Raw eclipse-zenoh: a declared publisher with blocking congestion control, and the default callback.

Modes: `attachment` (33 bytes beside each payload, as every ROS 2 sample has), `bare`, `shm` (attachment, and Zenoh's
own shared memory), `tuned` (attachment, and what Meta-ROS sets: threads, queue, allocator: nothing that is built on
eclipse-zenoh passes it). All else is eclipse-zenoh's default, except that nobody but the other process is looked for.
"""

from __future__ import annotations

import functools
import json
import os
from collections.abc import Callable
from typing import Any

import zenoh

from metaros.wire.allocator import keep_large_blocks
from metaros.wire.session import QUEUE_BATCHES, RUNTIME_THREADS

__all__ = ["receiver", "sender"]

_ATTACHMENT = bytes(33)


@functools.cache
def _session(role: str, port: int, mode: str) -> zenoh.Session:
    """The first process to start listens."""
    shared_memory, tuned = mode == "shm", mode == "tuned"
    config = zenoh.Config()
    endpoint = json.dumps([f"tcp/127.0.0.1:{port}"])
    listens = role in {"subscriber", "echo"}
    settings = {
        "scouting/multicast/enabled": "false",
        "listen/endpoints": endpoint if listens else "[]",
        "connect/endpoints": "[]" if listens else endpoint,
        "transport/shared_memory/enabled": json.dumps(shared_memory),
        "transport/shared_memory/mode": '"init"',
        "transport/shared_memory/transport_optimization/enabled": json.dumps(shared_memory),
    }
    if tuned:
        keep_large_blocks()
        os.environ["ZENOH_RUNTIME"] = RUNTIME_THREADS
        settings["transport/link/tx/queue/size/data"] = json.dumps(QUEUE_BATCHES)
    for key, value in settings.items():
        config.insert_json5(key, value)
    return zenoh.open(config)


def _session_of(job: dict[str, Any]) -> zenoh.Session:
    return _session(job["role"], job["ports"][0], job["mode"])


def sender(job: dict[str, Any], topic: str) -> Callable[[], object]:
    """`put` of the declared publisher."""
    publisher = _session_of(job).declare_publisher(f"bench/{topic}", congestion_control=zenoh.CongestionControl.BLOCK)
    payload = b"x" * job["size"]
    if job["mode"] == "bare":
        return functools.partial(publisher.put, payload)
    return functools.partial(publisher.put, payload, attachment=_ATTACHMENT)


def receiver(job: dict[str, Any], topic: str, callback: Callable[[], object]) -> None:
    """The default callback: a thread of its own for each subscriber."""

    def on_sample(sample: zenoh.Sample) -> None:
        sample.payload.to_bytes()
        callback()

    _session_of(job).declare_subscriber(f"bench/{topic}", on_sample)
