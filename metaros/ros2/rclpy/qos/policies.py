"""The policies of a QoS profile, by rclpy's names and numbers, and the names that were once theirs."""

from __future__ import annotations

import warnings
from enum import IntEnum
from typing import Any

__all__ = [
    "DurabilityPolicy",
    "HistoryPolicy",
    "LivelinessPolicy",
    "QoSDurabilityPolicy",
    "QoSHistoryPolicy",
    "QoSLivelinessPolicy",
    "QoSPolicyEnum",
    "QoSPolicyKind",
    "QoSReliabilityPolicy",
    "ReliabilityPolicy",
    "qos_policy_name_from_kind",
]


class QoSPolicyKind(IntEnum):
    """Which policy is meant: in events, and in overrides by parameters."""

    INVALID = 1
    DURABILITY = 2
    DEADLINE = 4
    LIVELINESS = 8
    RELIABILITY = 16
    HISTORY = 32
    LIFESPAN = 64
    DEPTH = 128
    LIVELINESS_LEASE_DURATION = 256
    AVOID_ROS_NAMESPACE_CONVENTIONS = 512


def qos_policy_name_from_kind(policy_kind: QoSPolicyKind | int) -> str:
    """The name of such a kind, by its number, too."""
    return QoSPolicyKind(policy_kind).name


class QoSPolicyEnum(IntEnum):
    """What the values of all policies share: short names in small letters, for tools."""

    @classmethod
    def short_keys(cls) -> list[str]:
        """The short names of all values."""
        return [name.lower() for name in cls.__members__]

    @classmethod
    def get_from_short_key(cls, name: str) -> int:
        """The number of the value of that short name, in large or small letters; KeyError where there is none."""
        return int(cls[name.upper()].value)

    @property
    def short_key(self) -> str:
        """The short name of this value."""
        return self.name.lower()


class _OldName:
    """A value's name of the time when they had C's; who reads it is told the new one."""

    def __init__(self, old: str, new: str) -> None:
        self._old, self._new = old, new

    def __get__(self, _: object, policy: Any) -> Any:
        name = policy.__name__
        warnings.warn(f"{name}.{self._old} is deprecated. Use {name}.{self._new} instead.", stacklevel=2)
        return policy[self._new]


def _with_old_names(policy: type[QoSPolicyEnum], names: str, prefix: str) -> None:
    for name in names.split():
        old = f"RMW_QOS_POLICY_{prefix}_{name}"
        setattr(policy, old, _OldName(old, name))


class HistoryPolicy(QoSPolicyEnum):
    """Whether a queue keeps the last `depth` samples or all of them."""

    SYSTEM_DEFAULT = 0
    KEEP_LAST = 1
    KEEP_ALL = 2
    UNKNOWN = 3


class ReliabilityPolicy(QoSPolicyEnum):
    """Whether samples may be lost on the way."""

    SYSTEM_DEFAULT = 0
    RELIABLE = 1
    BEST_EFFORT = 2
    UNKNOWN = 3
    BEST_AVAILABLE = 4


class DurabilityPolicy(QoSPolicyEnum):
    """Whether a publisher keeps its last samples for who comes later."""

    SYSTEM_DEFAULT = 0
    TRANSIENT_LOCAL = 1
    VOLATILE = 2
    UNKNOWN = 3
    BEST_AVAILABLE = 4


class LivelinessPolicy(QoSPolicyEnum):
    """Who says that a publisher is alive."""

    SYSTEM_DEFAULT = 0
    AUTOMATIC = 1
    MANUAL_BY_TOPIC = 3
    UNKNOWN = 4
    BEST_AVAILABLE = 5


QoSHistoryPolicy = HistoryPolicy
QoSReliabilityPolicy = ReliabilityPolicy
QoSDurabilityPolicy = DurabilityPolicy
QoSLivelinessPolicy = LivelinessPolicy

_with_old_names(HistoryPolicy, "SYSTEM_DEFAULT KEEP_LAST KEEP_ALL UNKNOWN", "HISTORY")
_with_old_names(ReliabilityPolicy, "SYSTEM_DEFAULT RELIABLE BEST_EFFORT UNKNOWN", "RELIABILITY")
_with_old_names(DurabilityPolicy, "SYSTEM_DEFAULT TRANSIENT_LOCAL VOLATILE UNKNOWN", "DURABILITY")
_with_old_names(LivelinessPolicy, "SYSTEM_DEFAULT AUTOMATIC MANUAL_BY_TOPIC", "LIVELINESS")
_with_old_names(LivelinessPolicy, "UNKNOWN", "DURABILITY")  # rclpy has it so
