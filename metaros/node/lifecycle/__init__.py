"""Lifecycle nodes: the managed node of ROS 2, and rules by which it looks after its own health."""

from metaros.node.lifecycle.health import Mode
from metaros.node.lifecycle.machine import Machine, Result, State, Transition
from metaros.node.lifecycle.managed import LifecyclePublisher
from metaros.node.lifecycle.node import LifecycleNode
from metaros.node.lifecycle.rules import Action, Decision, HealthRule, Step
from metaros.node.lifecycle.signals import (
    CallbackOverrun,
    CpuPercent,
    DeadlineMissed,
    ErrorCount,
    Signal,
    Temperature,
    TopicRate,
)
from metaros.node.lifecycle.watch import HealthWatch

__all__ = [
    "Action",
    "CallbackOverrun",
    "CpuPercent",
    "DeadlineMissed",
    "Decision",
    "ErrorCount",
    "HealthRule",
    "HealthWatch",
    "LifecycleNode",
    "LifecyclePublisher",
    "Machine",
    "Mode",
    "Result",
    "Signal",
    "State",
    "Step",
    "Temperature",
    "TopicRate",
    "Transition",
]
