"""`rclpy.topic_endpoint_info` and `rclpy.endpoint_info`: who publishes, subscribes, serves or calls, and how."""

from __future__ import annotations

from collections.abc import Sequence
from enum import IntEnum
from typing import Any, Final

from metaros.ros2.rclpy.names.type_hash import TypeHash
from metaros.ros2.rclpy.qos.profile import HistoryPolicy, QoSPresetProfiles, QoSProfile

__all__ = ["EndpointTypeEnum", "ServiceEndpointInfo", "TopicEndpointInfo", "TopicEndpointTypeEnum"]


class EndpointTypeEnum(IntEnum):
    """What kind of endpoint it is."""

    INVALID = 0
    PUBLISHER = 1
    SUBSCRIPTION = 2
    CLIENT = 3
    SERVER = 4


class TopicEndpointTypeEnum(IntEnum):
    """What kind of endpoint of a topic it is: Jazzy's name, before services had infos."""

    INVALID = 0
    PUBLISHER = 1
    SUBSCRIPTION = 2


class _Info:
    """Fields that can be set, each checked as rclpy does: AssertionError for a value of another type."""

    __slots__ = ("_endpoint_type", "_node_name", "_node_namespace")
    _kind: type[IntEnum]
    _fields: tuple[str, ...]

    @property
    def node_name(self) -> str:
        """The node's name."""
        return self._node_name

    @node_name.setter
    def node_name(self, value: str) -> None:
        self._node_name: str = _checked("node_name", value, str)

    @property
    def node_namespace(self) -> str:
        """The node's namespace."""
        return self._node_namespace

    @node_namespace.setter
    def node_namespace(self, value: str) -> None:
        self._node_namespace: str = _checked("node_namespace", value, str)

    @property
    def endpoint_type(self) -> Any:
        """Its kind."""
        return self._endpoint_type

    @endpoint_type.setter
    def endpoint_type(self, value: int) -> None:
        self._endpoint_type = self._kind(_checked("endpoint_type", value, int))

    def __eq__(self, other: object) -> bool:
        return type(other) is type(self) and all(getattr(self, f) == getattr(other, f) for f in self._fields)

    __hash__ = None  # type: ignore[assignment]  # as in rclpy: its fields can be set


class TopicEndpointInfo(_Info):
    """A publisher or subscription."""

    __slots__ = ("_endpoint_gid", "_qos_profile", "_topic_type", "_topic_type_hash")
    _kind = TopicEndpointTypeEnum
    _fields = (
        "node_name",
        "node_namespace",
        "topic_type",
        "topic_type_hash",
        "endpoint_type",
        "endpoint_gid",
        "qos_profile",
    )

    def __init__(
        self,
        node_name: str = "",
        node_namespace: str = "",
        topic_type: str = "",
        topic_type_hash: TypeHash | dict[str, Any] | None = None,
        endpoint_type: int = TopicEndpointTypeEnum.INVALID,
        endpoint_gid: Sequence[int] = (),
        qos_profile: QoSProfile | dict[str, Any] | None = None,
    ) -> None:
        self.node_name = node_name
        self.node_namespace = node_namespace
        self.topic_type = topic_type
        self.topic_type_hash = TypeHash() if topic_type_hash is None else topic_type_hash
        self.endpoint_type = endpoint_type
        self.endpoint_gid = list(endpoint_gid)
        self.qos_profile = QoSPresetProfiles.UNKNOWN.value if qos_profile is None else qos_profile

    @property
    def topic_type(self) -> str:
        """The name of its message type."""
        return self._topic_type

    @topic_type.setter
    def topic_type(self, value: str) -> None:
        self._topic_type: str = _checked("topic_type", value, str)

    @property
    def topic_type_hash(self) -> Any:
        """The `TypeHash` of that type; it can be set by the arguments of one, too."""
        return self._topic_type_hash

    @topic_type_hash.setter
    def topic_type_hash(self, value: Any) -> None:
        self._topic_type_hash = _made("topic_type_hash", value, TypeHash)

    @property
    def endpoint_gid(self) -> list[int]:
        """The bytes that name it in the graph."""
        return self._endpoint_gid

    @endpoint_gid.setter
    def endpoint_gid(self, value: list[int]) -> None:
        self._endpoint_gid = [_checked("endpoint_gid", byte, int) for byte in value]

    @property
    def qos_profile(self) -> Any:
        """Its `QoSProfile`; it can be set by the arguments of one, too."""
        return self._qos_profile

    @qos_profile.setter
    def qos_profile(self, value: Any) -> None:
        self._qos_profile = _made("qos_profile", value, QoSProfile)

    def __str__(self) -> str:
        lines = [
            f"Node name: {self.node_name}",
            f"Node namespace: {self.node_namespace}",
            f"Topic type: {self.topic_type}",
            f"Topic type hash: {self.topic_type_hash}",
            f"Endpoint type: {self.endpoint_type.name}",
            f"GID: {_gid(self.endpoint_gid)}",
            "QoS profile:",
            *_profile_lines(self.qos_profile, "  "),
        ]
        return "\n".join(lines)


class ServiceEndpointInfo(_Info):
    """A service server or client. Here each is one endpoint, with one profile and one GID."""

    __slots__ = ("_endpoint_count", "_endpoint_gids", "_qos_profiles", "_service_type", "_service_type_hash")
    _kind = EndpointTypeEnum
    _fields = (
        "node_name",
        "node_namespace",
        "service_type",
        "service_type_hash",
        "qos_profiles",
        "endpoint_gids",
        "endpoint_type",
        "endpoint_count",
    )

    def __init__(
        self,
        node_name: str = "",
        node_namespace: str = "",
        service_type: str = "",
        service_type_hash: TypeHash | dict[str, Any] | None = None,
        qos_profiles: Sequence[QoSProfile | dict[str, Any]] = (),
        endpoint_gids: Sequence[Sequence[int]] = (),
        endpoint_type: int = EndpointTypeEnum.INVALID,
        endpoint_count: int = 0,
    ) -> None:
        self.node_name = node_name
        self.node_namespace = node_namespace
        self.service_type = service_type
        self.service_type_hash = TypeHash() if service_type_hash is None else service_type_hash
        self.qos_profiles = list(qos_profiles)
        self.endpoint_gids = [list(gid) for gid in endpoint_gids]
        self.endpoint_type = endpoint_type
        self.endpoint_count = endpoint_count

    @property
    def service_type(self) -> str:
        """The name of its service type."""
        return self._service_type

    @service_type.setter
    def service_type(self, value: str) -> None:
        self._service_type: str = _checked("service_type", value, str)

    @property
    def service_type_hash(self) -> Any:
        """The `TypeHash` of that type; it can be set by the arguments of one, too."""
        return self._service_type_hash

    @service_type_hash.setter
    def service_type_hash(self, value: Any) -> None:
        self._service_type_hash = _made("service_type_hash", value, TypeHash)

    @property
    def qos_profiles(self) -> list[Any]:
        """The `QoSProfile` of each of its endpoints."""
        return self._qos_profiles

    @qos_profiles.setter
    def qos_profiles(self, value: list[Any]) -> None:
        self._qos_profiles = [_made("qos_profiles", one, QoSProfile) for one in _checked("qos_profiles", value, list)]

    @property
    def endpoint_gids(self) -> list[list[int]]:
        """The GID of each."""
        return self._endpoint_gids

    @endpoint_gids.setter
    def endpoint_gids(self, value: list[list[int]]) -> None:
        gids: list[list[int]] = _checked("endpoint_gids", value, list)
        self._endpoint_gids = [[_checked("endpoint_gids", byte, int) for byte in gid] for gid in gids]

    @property
    def endpoint_count(self) -> int:
        """How many endpoints it is made of: one on this wire, two over DDS."""
        return self._endpoint_count

    @endpoint_count.setter
    def endpoint_count(self, value: int) -> None:
        self._endpoint_count: int = _checked("endpoint_count", value, int)

    def __str__(self) -> str:
        lines = [
            f"Node name: {self.node_name}",
            f"Node namespace: {self.node_namespace}",
            f"Service type: {self.service_type}",
            f"Service type hash: {self.service_type_hash}",
            f"Endpoint type: {self.endpoint_type.name}",
            f"Endpoint count: {self.endpoint_count}",
        ]
        for gid, qos in zip(self.endpoint_gids, self.qos_profiles, strict=False):
            lines += [f"GID: {_gid(gid)}", "QoS profile:", *_profile_lines(qos, "  ")]
        return "\n".join(lines)


_SHOWN: Final = ("Reliability", "History (Depth)", "Durability", "Lifespan", "Deadline", "Liveliness")


def _profile_lines(qos: QoSProfile, indent: str) -> list[str]:
    history = qos.history.name if qos.history != HistoryPolicy.KEEP_LAST else f"{qos.history.name} ({qos.depth})"
    values = (qos.reliability.name, history, qos.durability.name, qos.lifespan, qos.deadline, qos.liveliness.name)
    lines = [f"{indent}{name}: {value}" for name, value in zip(_SHOWN, values, strict=True)]
    return [*lines, f"{indent}Liveliness lease duration: {qos.liveliness_lease_duration}"]


def _gid(gid: Sequence[int]) -> str:
    return ".".join(f"{byte:02x}" for byte in gid)


def _checked(name: str, value: Any, kind: type[Any]) -> Any:
    if not isinstance(value, kind):
        raise AssertionError(f"{name} is a {kind.__name__}, not {value!r}")
    return value


def _made(name: str, value: Any, kind: type[Any]) -> Any:
    return kind(**value) if isinstance(value, dict) else _checked(name, value, kind)
