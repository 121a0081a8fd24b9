"""`rclpy.qos`: QoS profiles, the presets, and all that belongs to them."""

from __future__ import annotations

import warnings
from enum import Enum
from typing import Any, Final, TypeVar

from metaros.errors import FieldError
from metaros.ros2.rclpy.qos.compatibility import QoSCompatibility, qos_check_compatible
from metaros.ros2.rclpy.qos.policies import (
    DurabilityPolicy,
    HistoryPolicy,
    LivelinessPolicy,
    QoSDurabilityPolicy,
    QoSHistoryPolicy,
    QoSLivelinessPolicy,
    QoSPolicyEnum,
    QoSPolicyKind,
    QoSReliabilityPolicy,
    ReliabilityPolicy,
    qos_policy_name_from_kind,
)
from metaros.ros2.rclpy.time.duration import Duration

__all__ = [
    "DeadlineBestAvailable",
    "DurabilityPolicy",
    "Duration",
    "HistoryPolicy",
    "InvalidQoSProfileException",
    "LivelinessLeaseDurationBestAvailable",
    "LivelinessLeaseDurationeBestAvailable",
    "LivelinessPolicy",
    "QoSCompatibility",
    "QoSDurabilityPolicy",
    "QoSHistoryPolicy",
    "QoSLivelinessPolicy",
    "QoSPolicyEnum",
    "QoSPolicyKind",
    "QoSPresetProfiles",
    "QoSProfile",
    "QoSReliabilityPolicy",
    "ReliabilityPolicy",
    "qos_check_compatible",
    "qos_policy_name_from_kind",
    "qos_profile_action_status_default",
    "qos_profile_best_available",
    "qos_profile_default",
    "qos_profile_parameter_events",
    "qos_profile_parameters",
    "qos_profile_rosout_default",
    "qos_profile_sensor_data",
    "qos_profile_services_default",
    "qos_profile_system_default",
    "qos_profile_unknown",
]

_T = TypeVar("_T")
_NONE: Final = Duration()  # ROS's word for no deadline, no lease, no end of a sample's life


class InvalidQoSProfileException(FieldError):
    """A profile lacks its depth."""

    def __init__(self, *args: object) -> None:
        super().__init__("Invalid QoSProfile", *args)


class _AsDictionary:
    """What stands for a profile of C, for code that asks for one and reads it again."""

    def __init__(self, fields: dict[str, Any]) -> None:
        self._fields = fields

    def to_dict(self) -> dict[str, Any]:
        """The arguments of `QoSProfile`."""
        return dict(self._fields)


class QoSProfile:
    """The promises of a publisher, or what a subscription asks for.

    `depth`, or a `history` that is not KEEP_LAST, is required. A duration of zero means none. Every field can be set.
    """

    __slots__ = (
        "_avoid_ros_namespace_conventions",
        "_deadline",
        "_depth",
        "_durability",
        "_history",
        "_lifespan",
        "_liveliness",
        "_liveliness_lease_duration",
        "_reliability",
    )

    def __init__(self, **kwargs: Any) -> None:
        """Any of `history`, `depth`, `reliability`, `durability`, `lifespan`, `deadline`, `liveliness`,
        `liveliness_lease_duration` and `avoid_ros_namespace_conventions`.
        """
        unknown = [name for name in kwargs if name not in _FIELDS]
        if unknown:
            raise AssertionError(f"Invalid arguments passed to constructor: {unknown}; there are {', '.join(_FIELDS)}")
        if "history" not in kwargs and "depth" not in kwargs:
            raise InvalidQoSProfileException("History and/or depth settings are required.")
        self.history = kwargs.get("history", HistoryPolicy.KEEP_LAST)
        if self.history == HistoryPolicy.KEEP_LAST and "depth" not in kwargs:
            raise InvalidQoSProfileException("History set to KEEP_LAST without a depth setting.")
        for name, default in _DEFAULTS.items():
            setattr(self, name, kwargs.get(name, default))

    @property
    def history(self) -> HistoryPolicy:
        """Whether the last `depth` samples are kept, or all."""
        return self._history

    @history.setter
    def history(self, value: HistoryPolicy | int) -> None:
        self._history = HistoryPolicy(_checked("history", value, int))

    @property
    def depth(self) -> int:
        """How many samples are kept; 0 leaves it to the system."""
        return self._depth

    @depth.setter
    def depth(self, value: int) -> None:
        _checked("depth", value, int)
        if value == 0 and self._history == HistoryPolicy.KEEP_LAST:
            text = "a depth of zero with KEEP_LAST keeps nothing: it is taken for SYSTEM_DEFAULT, give a depth"
            warnings.warn(text, stacklevel=2)
        self._depth = value

    @property
    def reliability(self) -> ReliabilityPolicy:
        """Whether samples may be lost on the way."""
        return self._reliability

    @reliability.setter
    def reliability(self, value: ReliabilityPolicy | int) -> None:
        self._reliability = ReliabilityPolicy(_checked("reliability", value, int))

    @property
    def durability(self) -> DurabilityPolicy:
        """Whether late subscriptions get what was published before."""
        return self._durability

    @durability.setter
    def durability(self, value: DurabilityPolicy | int) -> None:
        self._durability = DurabilityPolicy(_checked("durability", value, int))

    @property
    def lifespan(self) -> Duration:
        """After which a sample is not delivered any more."""
        return self._lifespan

    @lifespan.setter
    def lifespan(self, value: Duration) -> None:
        self._lifespan = _checked("lifespan", value, Duration)

    @property
    def deadline(self) -> Duration:
        """The longest time between two samples."""
        return self._deadline

    @deadline.setter
    def deadline(self, value: Duration) -> None:
        self._deadline = _checked("deadline", value, Duration)

    @property
    def liveliness(self) -> LivelinessPolicy:
        """Who says that the publisher is alive."""
        return self._liveliness

    @liveliness.setter
    def liveliness(self, value: LivelinessPolicy | int) -> None:
        self._liveliness = LivelinessPolicy(_checked("liveliness", value, int))

    @property
    def liveliness_lease_duration(self) -> Duration:
        """Within which a publisher has to say so."""
        return self._liveliness_lease_duration

    @liveliness_lease_duration.setter
    def liveliness_lease_duration(self, value: Duration) -> None:
        self._liveliness_lease_duration = _checked("liveliness_lease_duration", value, Duration)

    @property
    def avoid_ros_namespace_conventions(self) -> bool:
        """Kept, and without effect: on this wire topics have no prefix that could be left out."""
        return self._avoid_ros_namespace_conventions

    @avoid_ros_namespace_conventions.setter
    def avoid_ros_namespace_conventions(self, value: bool) -> None:
        self._avoid_ros_namespace_conventions = _checked("avoid_ros_namespace_conventions", value, bool)

    def get_c_qos_profile(self) -> _AsDictionary:
        """What has `to_dict()`: the fields of this profile, from which an equal one can be made."""
        return _AsDictionary({name: getattr(self, name) for name in _FIELDS})

    def __eq__(self, other: object) -> bool:
        return isinstance(other, QoSProfile) and all(getattr(self, f) == getattr(other, f) for f in _FIELDS)

    __hash__ = None  # type: ignore[assignment]  # as in rclpy: its fields can be set

    def __str__(self) -> str:
        return f"{type(self).__name__}({', '.join(f'{name}={getattr(self, name)}' for name in _FIELDS)})"

    __repr__ = __str__


def _checked(name: str, value: _T, kind: type[Any]) -> _T:
    """The value; AssertionError, as in rclpy, where it is of another type."""
    if not isinstance(value, kind):
        raise AssertionError(f"{name} of a QoSProfile is a {kind.__name__}, not {value!r}")
    return value


_DEFAULTS: Final[dict[str, Any]] = {
    "depth": 10,
    "reliability": ReliabilityPolicy.RELIABLE,
    "durability": DurabilityPolicy.VOLATILE,
    "lifespan": _NONE,
    "deadline": _NONE,
    "liveliness": LivelinessPolicy.SYSTEM_DEFAULT,
    "liveliness_lease_duration": _NONE,
    "avoid_ros_namespace_conventions": False,
}
_FIELDS: Final = ("history", *_DEFAULTS)

DeadlineBestAvailable: Final = Duration(nanoseconds=(1 << 63) - 2)
LivelinessLeaseDurationBestAvailable: Final = Duration(nanoseconds=(1 << 63) - 2)
LivelinessLeaseDurationeBestAvailable: Final = LivelinessLeaseDurationBestAvailable  # rclpy's spelling

qos_profile_unknown = QoSProfile(
    history=HistoryPolicy.UNKNOWN,
    depth=0,
    reliability=ReliabilityPolicy.UNKNOWN,
    durability=DurabilityPolicy.UNKNOWN,
    liveliness=LivelinessPolicy.UNKNOWN,
)
qos_profile_default = QoSProfile(depth=10)
qos_profile_system_default = QoSProfile(
    history=HistoryPolicy.SYSTEM_DEFAULT,
    depth=0,
    reliability=ReliabilityPolicy.SYSTEM_DEFAULT,
    durability=DurabilityPolicy.SYSTEM_DEFAULT,
)
qos_profile_sensor_data = QoSProfile(depth=5, reliability=ReliabilityPolicy.BEST_EFFORT)
qos_profile_services_default = QoSProfile(depth=10)
qos_profile_parameters = QoSProfile(depth=1000)
qos_profile_parameter_events = QoSProfile(depth=1000)
qos_profile_best_available = QoSProfile(
    depth=10,
    reliability=ReliabilityPolicy.BEST_AVAILABLE,
    durability=DurabilityPolicy.BEST_AVAILABLE,
    deadline=DeadlineBestAvailable,
    liveliness=LivelinessPolicy.BEST_AVAILABLE,
    liveliness_lease_duration=LivelinessLeaseDurationBestAvailable,
)
qos_profile_action_status_default = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)
qos_profile_rosout_default = QoSProfile(
    depth=1000, durability=DurabilityPolicy.TRANSIENT_LOCAL, lifespan=Duration(seconds=10)
)


class QoSPresetProfiles(Enum):
    """The presets by name; two that are equal are one value with two names."""

    UNKNOWN = qos_profile_unknown
    DEFAULT = qos_profile_default
    SYSTEM_DEFAULT = qos_profile_system_default
    SENSOR_DATA = qos_profile_sensor_data
    SERVICES_DEFAULT = qos_profile_services_default
    PARAMETERS = qos_profile_parameters
    PARAMETER_EVENTS = qos_profile_parameter_events
    ACTION_STATUS_DEFAULT = qos_profile_action_status_default
    BEST_AVAILABLE = qos_profile_best_available

    @classmethod
    def short_keys(cls) -> list[str]:
        """The names in small letters."""
        return [name.lower() for name in cls.__members__]

    @classmethod
    def get_from_short_key(cls, name: str) -> QoSProfile:
        """The preset of that name, in large or small letters; KeyError where there is none."""
        profile: QoSProfile = cls[name.upper()].value
        return profile
