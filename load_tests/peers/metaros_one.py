"""`metaros` 1.1.5 of PyPI, unmodified: its String, which is its cheapest message, through its own broker."""

from __future__ import annotations

import functools
from collections.abc import Callable
from typing import Any

from metaros import MessageBroker, Publisher, Subscriber
from metaros.messages import String

__all__ = ["broker", "receiver", "sender"]


def broker(job: dict[str, Any]) -> None:
    """The XSUB/XPUB proxy that every 1.x program needs."""
    MessageBroker(xsub_port=job["ports"][0], xpub_port=job["ports"][1])


def sender(job: dict[str, Any], topic: str) -> Callable[[], object]:
    """`publish`."""
    publisher = Publisher(f"/{topic}", String, port=job["ports"][0])
    return functools.partial(publisher.publish, String("x" * job["size"]))


def receiver(job: dict[str, Any], topic: str, callback: Callable[[], object]) -> None:
    """Its own thread, which sleeps for 50 ms after each message."""
    Subscriber(f"/{topic}", String, lambda _: callback(), port=job["ports"][1])
