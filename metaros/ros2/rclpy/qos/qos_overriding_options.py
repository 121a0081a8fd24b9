"""`rclpy.qos_overriding_options`: profiles that whoever starts a node may override by parameters.

The parameter of a topic's depth is `qos_overrides./topic.publisher.depth`, with an id `…publisher_id.depth`.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from typing import Any, Final

from metaros.errors import ConfigError
from metaros.ros2.rclpy.core.publisher import Publisher
from metaros.ros2.rclpy.core.subscription import Subscription
from metaros.ros2.rclpy.names.exceptions import ParameterAlreadyDeclaredException
from metaros.ros2.rclpy.qos.policies import (
    DurabilityPolicy,
    HistoryPolicy,
    LivelinessPolicy,
    QoSPolicyEnum,
    QoSPolicyKind,
    ReliabilityPolicy,
)
from metaros.ros2.rclpy.qos.profile import QoSProfile
from metaros.ros2.rclpy.time.duration import Duration
from metaros.ros2.rosidl.catalogue import interface

__all__ = [
    "InvalidQosOverridesError",
    "QoSOverridingOptions",
    "QoSPolicyKind",
    "QosCallbackResult",
    "QosCallbackType",
    "declare_qos_parameters",
]

QosCallbackResult: Any  # a message, whose class is made when somebody wants it
QosCallbackType = Callable[[QoSProfile], Any]  # returns a QosCallbackResult

_POLICIES: Final[dict[QoSPolicyKind, type[QoSPolicyEnum]]] = {
    QoSPolicyKind.LIVELINESS: LivelinessPolicy,
    QoSPolicyKind.RELIABILITY: ReliabilityPolicy,
    QoSPolicyKind.HISTORY: HistoryPolicy,
    QoSPolicyKind.DURABILITY: DurabilityPolicy,
}
_DURATIONS: Final = (QoSPolicyKind.LIFESPAN, QoSPolicyKind.DEADLINE, QoSPolicyKind.LIVELINESS_LEASE_DURATION)


def __getattr__(name: str) -> Any:
    if name == "QosCallbackResult":
        return interface("rcl_interfaces/msg/SetParametersResult")
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")


class InvalidQosOverridesError(ConfigError):
    """The callback refuses the profile that parameters made; the message has its reason."""


class QoSOverridingOptions:
    """Which policies may be overridden. `callback(qos)` looks at the result and returns a `QosCallbackResult`.

    `entity_id` tells apart several publishers, or subscriptions, of one topic on one node.
    """

    def __init__(
        self,
        policy_kinds: Iterable[QoSPolicyKind],
        *,
        callback: QosCallbackType | None = None,
        entity_id: str | None = None,
    ) -> None:
        self._policy_kinds = policy_kinds
        self._callback = callback
        self._entity_id = entity_id

    @property
    def policy_kinds(self) -> Iterable[QoSPolicyKind]:
        """The policies that get a parameter."""
        return self._policy_kinds

    @property
    def callback(self) -> QosCallbackType | None:
        """What looks at the result."""
        return self._callback

    @property
    def entity_id(self) -> str | None:
        """The id, if there is one."""
        return self._entity_id

    @classmethod
    def with_default_policies(
        cls, *, callback: QosCallbackType | None = None, entity_id: str | None = None
    ) -> QoSOverridingOptions:
        """For history, depth and reliability."""
        kinds = (QoSPolicyKind.HISTORY, QoSPolicyKind.DEPTH, QoSPolicyKind.RELIABILITY)
        return cls(kinds, callback=callback, entity_id=entity_id)


def declare_qos_parameters(
    entity_type: type[Publisher] | type[Subscription],
    node: Any,
    topic_name: str,
    qos: QoSProfile,
    options: QoSOverridingOptions,
) -> None:
    """Declare the parameters, read-only, on the rclpy `node`, and write what they say into `qos`.

    Raises:
        TypeError: of what is neither a publisher nor a subscription.
        RuntimeError: a parameter is none of its policy's values.
        InvalidQosOverridesError: the callback of the options refuses the result.
    """
    if not issubclass(entity_type, Publisher | Subscription):
        raise TypeError(f"entity_type is Publisher or Subscription, or derives from one, not {entity_type!r}")
    entity = "publisher" if issubclass(entity_type, Publisher) else "subscription"
    suffix = "" if options.entity_id is None else f"_{options.entity_id}"
    what = f"for {entity} `{topic_name}` with id `{options.entity_id}`"
    for kind in options.policy_kinds:
        if kind is QoSPolicyKind.LIFESPAN and entity == "subscription":
            continue  # a publisher's alone
        policy = kind.name.lower()
        name = f"qos_overrides.{topic_name}.{entity}{suffix}.{policy}"
        descriptor = interface("rcl_interfaces/msg/ParameterDescriptor")()
        descriptor.description = f"{policy} {what}"
        descriptor.read_only = True
        try:
            parameter = node.declare_parameter(name, _get_qos_policy_parameter(qos, kind), descriptor)
        except ParameterAlreadyDeclaredException:
            parameter = node.get_parameter(name)
        _override(qos, kind, parameter.value)
    if options.callback is not None:
        result = options.callback(qos)
        if not result.successful:
            raise InvalidQosOverridesError(f"the QoS overrides {what} are not valid: {result.reason}")


_declare_qos_parameters = declare_qos_parameters  # rclpy's name of it


def _get_qos_policy_parameter(qos: QoSProfile, policy: QoSPolicyKind) -> str | int | bool:
    """A policy's value as a parameter has it: a short name, or nanoseconds."""
    value = getattr(qos, policy.name.lower())
    if isinstance(value, QoSPolicyEnum):
        if value.short_key == "unknown":
            raise ValueError(f"the QoS profile has an unknown {policy.name.lower()}: give it a value")
        return value.short_key
    return int(value.nanoseconds) if isinstance(value, Duration) else value


def _override(qos: QoSProfile, policy: QoSPolicyKind, value: Any) -> None:
    name = policy.name.lower()
    if policy in _POLICIES:
        kind = _POLICIES[policy]
        try:
            value = kind[value.upper()]
        except KeyError:
            known = ", ".join(kind.short_keys())
            raise RuntimeError(f"Unexpected QoS override for policy `{name}`: `{value}`; there are {known}") from None
    elif policy in _DURATIONS:
        value = Duration(nanoseconds=value)
    setattr(qos, name, value)
