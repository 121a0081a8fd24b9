"""Between rclpy's profiles and those of this library's wire."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Final

from metaros.ros2.rclpy.qos.policies import DurabilityPolicy, HistoryPolicy, LivelinessPolicy, ReliabilityPolicy
from metaros.ros2.rclpy.qos.profile import DeadlineBestAvailable, QoSProfile
from metaros.ros2.rclpy.time.duration import Duration
from metaros.wire import QoSProfile as WireProfile
from metaros.wire.qos import INFINITE_NS, Durability, History, Liveliness, Reliability

__all__ = ["from_native", "to_native"]

_BEST_NS: Final = DeadlineBestAvailable.nanoseconds


def to_native(qos: QoSProfile, *, peers: Iterable[WireProfile] = (), publishes: bool = False) -> WireProfile:
    """The wire's profile. What is "best available" is chosen now, so that it matches the `peers` on the topic.

    With `publishes` they are subscriptions, otherwise publishers. Unknown policies are the system's defaults.
    """
    known = [peer.resolved() for peer in peers]
    return WireProfile(
        reliability=_reliability(qos, known, publishes=publishes),
        durability=_durability(qos, known, publishes=publishes),
        history=History.SYSTEM_DEFAULT if qos.history == HistoryPolicy.UNKNOWN else History(qos.history),
        depth=qos.depth,
        deadline_ns=_period_ns(qos.deadline, [peer.deadline_ns for peer in known], publishes=publishes),
        lifespan_ns=_period_ns(qos.lifespan, (), publishes=publishes),
        liveliness=_liveliness(qos, known, publishes=publishes),
        lease_ns=_period_ns(qos.liveliness_lease_duration, [peer.lease_ns for peer in known], publishes=publishes),
    ).resolved()


def from_native(qos: WireProfile) -> QoSProfile:
    """rclpy's profile of what the graph shows: no period is an infinite one there."""
    manual_by_node = qos.liveliness is Liveliness.MANUAL_BY_NODE  # rclpy has it no more
    return QoSProfile(
        history=HistoryPolicy(qos.history),
        depth=qos.depth,
        reliability=ReliabilityPolicy(qos.reliability),
        durability=DurabilityPolicy(qos.durability),
        deadline=Duration(nanoseconds=qos.deadline_ns),
        lifespan=Duration(nanoseconds=qos.lifespan_ns),
        liveliness=LivelinessPolicy.UNKNOWN if manual_by_node else LivelinessPolicy(qos.liveliness),
        liveliness_lease_duration=Duration(nanoseconds=qos.lease_ns),
    )


def _reliability(qos: QoSProfile, peers: list[WireProfile], *, publishes: bool) -> Reliability:
    if qos.reliability == ReliabilityPolicy.UNKNOWN:
        return Reliability.SYSTEM_DEFAULT
    if qos.reliability != ReliabilityPolicy.BEST_AVAILABLE:
        return Reliability(qos.reliability)
    if publishes or all(peer.reliability is Reliability.RELIABLE for peer in peers):
        return Reliability.RELIABLE
    return Reliability.BEST_EFFORT


def _durability(qos: QoSProfile, peers: list[WireProfile], *, publishes: bool) -> Durability:
    if qos.durability == DurabilityPolicy.UNKNOWN:
        return Durability.SYSTEM_DEFAULT
    if qos.durability != DurabilityPolicy.BEST_AVAILABLE:
        return Durability(qos.durability)
    if publishes or all(peer.durability is Durability.TRANSIENT_LOCAL for peer in peers):
        return Durability.TRANSIENT_LOCAL
    return Durability.VOLATILE


def _liveliness(qos: QoSProfile, peers: list[WireProfile], *, publishes: bool) -> Liveliness:
    if qos.liveliness == LivelinessPolicy.UNKNOWN:
        return Liveliness.SYSTEM_DEFAULT
    if qos.liveliness != LivelinessPolicy.BEST_AVAILABLE:
        return Liveliness(qos.liveliness)
    manual = [peer.liveliness is Liveliness.MANUAL_BY_TOPIC for peer in peers]
    strict = any(manual) if publishes else bool(manual) and all(manual)
    return Liveliness.MANUAL_BY_TOPIC if strict else Liveliness.AUTOMATIC


def _period_ns(duration: Duration, peers: Iterable[int], *, publishes: bool) -> int:
    nanoseconds = int(duration.nanoseconds)
    if nanoseconds != _BEST_NS:
        return min(nanoseconds, INFINITE_NS)
    return (min if publishes else max)(peers, default=INFINITE_NS)  # what satisfies each of them
