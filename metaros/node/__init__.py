"""Nodes: publishers, subscriptions, services, clients and timers on the ROS 2 wire."""

from metaros.node.action import ActionClient, ActionResult, ActionServer, ClientGoal, GoalState, ServerGoal
from metaros.node.client import Client, RawClient
from metaros.node.context import Context
from metaros.node.events import PublisherEvents, SubscriptionEvents
from metaros.node.info import MessageInfo
from metaros.node.logger import Logger
from metaros.node.node import Node
from metaros.node.publisher import Publisher, RawPublisher
from metaros.node.rate import Rate
from metaros.node.service import Service
from metaros.node.sim_time import SimClock
from metaros.node.spin import spin
from metaros.node.subscription import RawSubscription, Subscription

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
