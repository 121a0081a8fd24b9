"""Lifecycle nodes: the managed node of ROS 2, and health rules by which it degrades, restarts or stops itself."""

from metaros.node.lifecycle.health import Mode
from metaros.node.lifecycle.health_rules import Action, Decision, HealthRule, Step
from metaros.node.lifecycle.health_watch import HealthWatch
from metaros.node.lifecycle.managed import LifecyclePublisher
from metaros.node.lifecycle.node import LifecycleNode
from metaros.node.lifecycle.signals import (
    CallbackOverrun,
    CpuPercent,
    DeadlineMissed,
    ErrorCount,
    Signal,
    Temperature,
    TopicRate,
)
from metaros.node.lifecycle.state_machine import Result, State, StateMachine, Transition

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
    "Mode",
    "Result",
    "Signal",
    "State",
    "StateMachine",
    "Step",
    "Temperature",
    "TopicRate",
    "Transition",
]
