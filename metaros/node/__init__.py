"""Nodes: publishers, subscriptions, services, clients and timers on the ROS 2 wire."""

from __future__ import annotations

import importlib
from typing import TYPE_CHECKING, Any

from metaros.node.client import Client, RawClient
from metaros.node.context import Context
from metaros.node.events import PublisherEvents, SubscriptionEvents
from metaros.node.info import MessageInfo
from metaros.node.logger import Logger
from metaros.node.node import Node
from metaros.node.publisher import Publisher, RawPublisher
from metaros.node.service import Service
from metaros.node.spin import spin
from metaros.node.subscription import RawSubscription, Subscription
from metaros.node.time.rate import Rate
from metaros.node.time.sim_time import SimClock

if TYPE_CHECKING:
    from metaros.node.action import ActionClient, ActionResult, ActionServer, ClientGoal, GoalState, ServerGoal

__all__ = [
    "ActionClient",
    "ActionResult",
    "ActionServer",
    "Client",
    "ClientGoal",
    "Context",
    "GoalState",
    "Logger",
    "MessageInfo",
    "Node",
    "Publisher",
    "PublisherEvents",
    "Rate",
    "RawClient",
    "RawPublisher",
    "RawSubscription",
    "ServerGoal",
    "Service",
    "SimClock",
    "Subscription",
    "SubscriptionEvents",
    "spin",
]

_ACTIONS = ("ActionClient", "ActionResult", "ActionServer", "ClientGoal", "GoalState", "ServerGoal")


def __getattr__(name: str) -> Any:
    if name not in _ACTIONS:  # most nodes have no actions: they start sooner without
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    return getattr(importlib.import_module("metaros.node.action"), name)
