"""Executors: which thread runs a node's callbacks, and what waits meanwhile."""

from metaros.executor.fair import FairExecutor, NodeShare
from metaros.executor.groups import CallbackGroup, MutuallyExclusiveCallbackGroup, ReentrantCallbackGroup
from metaros.executor.in_asyncio import AsyncioExecutor
from metaros.executor.ingress import Ingress
from metaros.executor.mailbox import Mailbox
from metaros.executor.pool import MultiThreadedExecutor
from metaros.executor.protocol import Executor, Spinnable
from metaros.executor.single import SingleThreadedExecutor
from metaros.executor.timers import Timer, TimerHeap, TimerStatistics

__all__ = [
    "AsyncioExecutor",
    "CallbackGroup",
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
