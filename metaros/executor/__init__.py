"""Executors: which thread runs a node's callbacks, and what waits meanwhile."""

from metaros.executor.ingress import Ingress
from metaros.executor.mailbox import Mailbox
from metaros.executor.protocol import Executor, Spinnable
from metaros.executor.single import SingleThreadedExecutor
from metaros.executor.timers import Timer, TimerHeap

__all__ = ["Executor", "Ingress", "Mailbox", "SingleThreadedExecutor", "Spinnable", "Timer", "TimerHeap"]
