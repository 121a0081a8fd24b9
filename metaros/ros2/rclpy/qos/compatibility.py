"""Whether a publisher's profile satisfies a subscription's, as far as the profiles alone tell."""

from __future__ import annotations

from collections.abc import Iterator
from enum import IntEnum
from typing import Any, Final

from metaros.ros2.rclpy.qos.policies import DurabilityPolicy, LivelinessPolicy, ReliabilityPolicy

__all__ = ["QoSCompatibility", "qos_check_compatible"]

_BEST_AVAILABLE_NS: Final = (1 << 63) - 2


class QoSCompatibility(IntEnum):
    """What the check found; WARNING where a system default or an unknown policy leaves it open."""

    OK = 0
    WARNING = 1
    ERROR = 2


# Of each policy: what the publisher offers, what the subscription asks for, between which nothing passes.
_NEVER: Final = (
    ("reliability", ReliabilityPolicy.BEST_EFFORT, ReliabilityPolicy.RELIABLE),
    ("durability", DurabilityPolicy.VOLATILE, DurabilityPolicy.TRANSIENT_LOCAL),
    ("liveliness", LivelinessPolicy.AUTOMATIC, LivelinessPolicy.MANUAL_BY_TOPIC),
)
_OPEN: Final = ("SYSTEM_DEFAULT", "UNKNOWN")


def qos_check_compatible(publisher_qos: Any, subscription_qos: Any) -> tuple[QoSCompatibility, str]:
    """Whether samples would pass between the two `QoSProfile`s, and why not; "" for the reason where they would."""
    errors = list(_errors(publisher_qos, subscription_qos))
    warnings = list(_warnings(publisher_qos, subscription_qos))
    reasons = [f"ERROR: {text};" for text in errors] + [f"WARNING: {text};" for text in warnings]
    if errors:
        return QoSCompatibility.ERROR, "".join(reasons)
    return QoSCompatibility.WARNING if warnings else QoSCompatibility.OK, "".join(reasons)


def _errors(offered: Any, requested: Any) -> Iterator[str]:
    for policy, offer, request in _NEVER:
        if getattr(offered, policy) == offer and getattr(requested, policy) == request:
            yield f"{policy}: {offer.name} is offered, {request.name} requested"
    for policy in ("deadline", "liveliness_lease_duration"):
        offer_ns, request_ns = (_period_ns(getattr(qos, policy)) for qos in (offered, requested))
        if request_ns is not None and (offer_ns is None or offer_ns > request_ns) and offer_ns != _BEST_AVAILABLE_NS:
            yield f"{policy}: {_shown(offer_ns)} is offered, {_shown(request_ns)} requested"


def _warnings(offered: Any, requested: Any) -> Iterator[str]:
    """Where one side is open and the other is one that not every choice would satisfy."""
    for policy, offer, request in _NEVER:
        given, wanted = getattr(offered, policy), getattr(requested, policy)
        if given.name in _OPEN and (wanted == request or wanted.name in _OPEN):
            yield f"{policy}: {given.name} is offered, which may not satisfy {wanted.name}"
        elif given == offer and wanted.name in _OPEN:
            yield f"{policy}: {given.name} is offered, and {wanted.name} may be requested as {request.name}"


def _period_ns(duration: Any) -> int | None:
    """None for no period at all; "best available" is whatever the other side has."""
    nanoseconds = int(duration.nanoseconds)
    return None if nanoseconds == 0 or nanoseconds > _BEST_AVAILABLE_NS else nanoseconds


def _shown(nanoseconds: int | None) -> str:
    return "none" if nanoseconds is None else f"{nanoseconds / 1e9:g} s"
