"""Executors: which thread runs a node's callbacks, and what waits meanwhile."""

from __future__ import annotations

import importlib
from typing import TYPE_CHECKING, Any

from metaros.executor.channel_mailbox import CHANNEL, ChannelMailbox
from metaros.executor.groups import CallbackGroup, MutuallyExclusiveCallbackGroup, ReentrantCallbackGroup
from metaros.executor.ingress import Ingress
from metaros.executor.mailbox import Mailbox
from metaros.executor.protocol import Executor, Spinnable
from metaros.executor.single import SingleThreadedExecutor
from metaros.executor.timers import Timer, TimerHeap, TimerStatistics

if TYPE_CHECKING:
    from metaros.executor.asyncio_executor import AsyncioExecutor
    from metaros.executor.fair_executor import FairExecutor, NodeShare
    from metaros.executor.pool import MultiThreadedExecutor

__all__ = [
    "CHANNEL",
    "AsyncioExecutor",
    "CallbackGroup",
    "ChannelMailbox",
    "Executor",
    "FairExecutor",
    "Ingress",
    "Mailbox",
    "MultiThreadedExecutor",
    "MutuallyExclusiveCallbackGroup",
    "NodeShare",
    "ReentrantCallbackGroup",
    "SingleThreadedExecutor",
    "Spinnable",
    "Timer",
    "TimerHeap",
    "TimerStatistics",
]

_LAZY = {  # what a node that spins on one thread never needs
    "AsyncioExecutor": "asyncio_executor",
    "FairExecutor": "fair_executor",
    "MultiThreadedExecutor": "pool",
    "NodeShare": "fair_executor",
}


def __getattr__(name: str) -> Any:
    if name not in _LAZY:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    return getattr(importlib.import_module(f"metaros.executor.{_LAZY[name]}"), name)
