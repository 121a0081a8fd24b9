"""The least that executors spin: an ingress, timers, a clock, and no network."""

from __future__ import annotations

import asyncio
from typing import Any

from metaros.clock import Clock
from metaros.executor import CallbackGroup, Ingress, Mailbox, TimerHeap


class Item:
    """What arrives: like a sample, it knows its key."""

    def __init__(self, key_expr: str, value: Any = None, size_bytes: int = 10) -> None:
        self.key_expr = key_expr
        self.value = value
        self.size_bytes = size_bytes


class SmallNode:
    """The least that an executor spins."""

    def __init__(self, ingress: Ingress, clock: Clock) -> None:
        self.ingress = ingress
        self.clock = clock
        self.timers = TimerHeap(clock.monotonic_s, ingress.wake)
        self.closed = False
        self.nice = 0
        self.critical = False

    def listen(
        self,
        key: str,
        handle: Any,
        *,
        depth: int | None = 10,
        limit_bytes: int = 10_000,
        group: CallbackGroup | None = None,
    ) -> Mailbox:
        box = Mailbox(
            handle,
            owner=self,
            depth=depth,
            limit_bytes=limit_bytes,
            size_of=lambda item: int(item.size_bytes),
            group=group,
        )
        self.ingress.route(key, box)
        self.ingress.async_work |= asyncio.iscoroutinefunction(handle)
        return box
