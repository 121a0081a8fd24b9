"""Quality of service: profiles, their text on the wire, and which offer satisfies which request."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from enum import IntEnum
from typing import Final, TypeVar

from metaros.errors import FieldError, TokenError

__all__ = [
    "INFINITE_NS",
    "Congestion",
    "Durability",
    "DurabilityPolicy",
    "History",
    "HistoryPolicy",
    "Liveliness",
    "LivelinessPolicy",
    "Priority",
    "QoSDurabilityPolicy",
    "QoSHistoryPolicy",
    "QoSLivelinessPolicy",
    "QoSProfile",
    "QoSReliabilityPolicy",
    "Reliability",
    "ReliabilityPolicy",
    "incompatibilities",
    "qos_command",
    "qos_default",
    "qos_parameters",
    "qos_reliable_all",
    "qos_rosout",
    "qos_sensor_data",
    "qos_services",
    "qos_transient_local",
]

INFINITE_NS: Final = (1 << 63) - 1
WIRE_DEPTH: Final = 42  # the depth that rmw_zenoh leaves out of the text
_SECOND_NS: Final = 1_000_000_000
_E = TypeVar("_E", bound=IntEnum)


class Reliability(IntEnum):
    """Whether samples may be lost on the way."""

    SYSTEM_DEFAULT = 0
    RELIABLE = 1
    BEST_EFFORT = 2
    UNKNOWN = 3
    BEST_AVAILABLE = 4


class Durability(IntEnum):
    """Whether a publisher keeps its last samples for who comes later."""

    SYSTEM_DEFAULT = 0
    TRANSIENT_LOCAL = 1
    VOLATILE = 2
    UNKNOWN = 3
    BEST_AVAILABLE = 4


class History(IntEnum):
    """Whether a queue keeps the last `depth` samples or all."""

    SYSTEM_DEFAULT = 0
    KEEP_LAST = 1
    KEEP_ALL = 2
    UNKNOWN = 3


class Liveliness(IntEnum):
    """Who says that a publisher is alive."""

    SYSTEM_DEFAULT = 0
    AUTOMATIC = 1
    MANUAL_BY_NODE = 2
    MANUAL_BY_TOPIC = 3
    UNKNOWN = 4
    BEST_AVAILABLE = 5


# The names in rclpy.qos, its old and its present ones: the same classes, so that code from there finds them.
ReliabilityPolicy = Reliability
DurabilityPolicy = Durability
HistoryPolicy = History
LivelinessPolicy = Liveliness
QoSReliabilityPolicy = Reliability
QoSDurabilityPolicy = Durability
QoSHistoryPolicy = History
QoSLivelinessPolicy = Liveliness


class Priority(IntEnum):
    """Which of a publisher's links' queues its samples take; a graver one is sent first. Zenoh's own levels."""

    REAL_TIME = 1
    INTERACTIVE_HIGH = 2
    INTERACTIVE_LOW = 3
    DATA_HIGH = 4
    DATA = 5
    DATA_LOW = 6
    BACKGROUND = 7


class Congestion(IntEnum):
    """What a publisher does while its link's queue is full."""

    AUTO = 0  # as rmw_zenoh: BLOCK when reliable and keep-all, else DROP
    DROP = 1
    BLOCK = 2


@dataclass(frozen=True, slots=True, kw_only=True)
class QoSProfile:
    """One profile. Durations in nanoseconds; `INFINITE_NS` (and 0, as in ROS) means none.

    `priority` and `congestion` are ours: they concern the publisher's own sending, no peer sees them, and two
    profiles that differ only there are equal.
    """

    reliability: Reliability = Reliability.RELIABLE
    durability: Durability = Durability.VOLATILE
    history: History = History.KEEP_LAST
    depth: int = 10
    deadline_ns: int = INFINITE_NS
    lifespan_ns: int = INFINITE_NS
    liveliness: Liveliness = Liveliness.AUTOMATIC
    lease_ns: int = INFINITE_NS
    priority: Priority = field(default=Priority.DATA, compare=False)
    congestion: Congestion = field(default=Congestion.AUTO, compare=False)

    def __post_init__(self) -> None:
        """Refuse what no peer would understand."""
        if not 0 <= self.depth < 1 << 31:
            raise FieldError(f"QoS depth {self.depth} is not within 0..{(1 << 31) - 1}")
        for name in ("deadline_ns", "lifespan_ns", "lease_ns"):
            if not 0 <= getattr(self, name) <= INFINITE_NS:
                raise FieldError(f"QoS {name} {getattr(self, name)} is not within 0..{INFINITE_NS}")

    def resolved(self) -> QoSProfile:
        """The same profile with every system default and zero replaced by what it stands for."""
        return replace(
            self,
            reliability=self.reliability or Reliability.RELIABLE,
            durability=self.durability or Durability.VOLATILE,
            history=self.history or History.KEEP_LAST,
            depth=self.depth or WIRE_DEPTH,
            deadline_ns=self.deadline_ns or INFINITE_NS,
            lifespan_ns=self.lifespan_ns or INFINITE_NS,
            liveliness=self.liveliness or Liveliness.AUTOMATIC,
            lease_ns=self.lease_ns or INFINITE_NS,
        )

    @property
    def blocks(self) -> bool:
        """Whether a publisher waits while its link's queue is full, rather than drop a sample."""
        if self.congestion is Congestion.AUTO:
            return self.reliability is not Reliability.BEST_EFFORT and self.history is History.KEEP_ALL
        return self.congestion is Congestion.BLOCK

    def encode(self) -> str:
        """The text in a liveliness token; each component is left out where it equals the wire's default."""
        qos = self.resolved()
        reliability = _elide(qos.reliability, Reliability.RELIABLE)
        durability = _elide(qos.durability, Durability.VOLATILE)
        history = f"{_elide(qos.history, History.KEEP_LAST)},{_elide(qos.depth, WIRE_DEPTH)}"
        liveliness = f"{_elide(qos.liveliness, Liveliness.AUTOMATIC)},{_duration(qos.lease_ns)}"
        durations = f"{_duration(qos.deadline_ns)}:{_duration(qos.lifespan_ns)}"
        return f"{reliability}:{durability}:{history}:{durations}:{liveliness}"

    @classmethod
    def decode(cls, text: str) -> QoSProfile:
        """Read such a text; TokenError for any other."""
        parts = text.split(":")
        if len(parts) < 6:
            raise TokenError(f"QoS string {text[:80]!r} has {len(parts)} parts: 6 are required")
        history, liveliness = parts[2].split(","), parts[5].split(",")
        if len(history) < 2 or len(liveliness) < 3:
            raise TokenError(f"QoS string {text[:80]!r} lacks the history depth or the liveliness lease")
        depth = _number(history[1], WIRE_DEPTH)
        if depth >= 1 << 31:
            raise TokenError(f"QoS depth {depth} is out of range")
        return cls(
            reliability=_enum(Reliability, parts[0], Reliability.RELIABLE),
            durability=_enum(Durability, parts[1], Durability.VOLATILE),
            history=_enum(History, history[0], History.KEEP_LAST),
            depth=depth,
            deadline_ns=_nanoseconds(parts[3]),
            lifespan_ns=_nanoseconds(parts[4]),
            liveliness=_enum(Liveliness, liveliness[0], Liveliness.AUTOMATIC),
            lease_ns=_nanoseconds(",".join(liveliness[1:])),
        )


def _elide(value: int, default: int) -> str:
    return "" if value == default else str(int(value))


def _duration(nanoseconds: int) -> str:
    if nanoseconds == INFINITE_NS:
        return ","
    return f"{nanoseconds // _SECOND_NS},{nanoseconds % _SECOND_NS}"


def _number(text: str, default: int) -> int:
    if not text:
        return default
    if not (text.isascii() and text.isdigit() and len(text) <= 19):
        raise TokenError(f"{text[:80]!r} in a QoS string is no number")
    return int(text)


def _enum(kind: type[_E], text: str, default: _E) -> _E:
    try:
        return kind(_number(text, default))
    except ValueError:
        raise TokenError(f"{text} is no {kind.__name__.lower()} of a QoS string") from None


def _nanoseconds(text: str) -> int:
    seconds, _, rest = text.partition(",")
    total = _number(seconds, INFINITE_NS // _SECOND_NS) * _SECOND_NS + _number(rest, INFINITE_NS % _SECOND_NS)
    return min(total, INFINITE_NS) or INFINITE_NS


def incompatibilities(offered: QoSProfile, requested: QoSProfile) -> tuple[str, ...]:
    """Why an offer does not satisfy a request by ROS 2's rules, each as `policy: reason`; empty when it does."""
    offer, request = offered.resolved(), requested.resolved()
    reasons = []
    if offer.reliability is Reliability.BEST_EFFORT and request.reliability is Reliability.RELIABLE:
        reasons.append("reliability: best_effort is offered, reliable requested")
    if offer.durability is Durability.VOLATILE and request.durability is Durability.TRANSIENT_LOCAL:
        reasons.append("durability: volatile is offered, transient_local requested")
    if offer.deadline_ns > request.deadline_ns:
        reasons.append(f"deadline: {_shown(offer.deadline_ns)} is offered, {_shown(request.deadline_ns)} requested")
    if offer.liveliness is Liveliness.AUTOMATIC and request.liveliness is Liveliness.MANUAL_BY_TOPIC:
        reasons.append("liveliness: automatic is offered, manual_by_topic requested")
    if offer.lease_ns > request.lease_ns:
        lease = f"a lease of {_shown(offer.lease_ns)} is offered, {_shown(request.lease_ns)} requested"
        reasons.append(f"liveliness: {lease}")
    return tuple(reasons)


def _shown(nanoseconds: int) -> str:
    return "none" if nanoseconds == INFINITE_NS else f"{nanoseconds / _SECOND_NS:g} s"


qos_default: Final = QoSProfile()
qos_sensor_data: Final = QoSProfile(reliability=Reliability.BEST_EFFORT, depth=5, priority=Priority.DATA_LOW)
qos_command: Final = QoSProfile(depth=1, priority=Priority.REAL_TIME, congestion=Congestion.BLOCK)
qos_reliable_all: Final = QoSProfile(history=History.KEEP_ALL)
qos_transient_local: Final = QoSProfile(durability=Durability.TRANSIENT_LOCAL, depth=1)
qos_services: Final = QoSProfile()
qos_parameters: Final = QoSProfile(depth=1000)
qos_rosout: Final = QoSProfile(
    durability=Durability.TRANSIENT_LOCAL, depth=1000, lifespan_ns=10 * _SECOND_NS, priority=Priority.BACKGROUND
)
