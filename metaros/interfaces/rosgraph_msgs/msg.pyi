# ruff: noqa: A002
"""The messages of rosgraph_msgs."""

from collections.abc import Sequence
from typing import Any, Final

import numpy as np
import numpy.typing as npt

from metaros.idl import Message
from metaros.interfaces.builtin_interfaces import msg as builtin_interfaces_msg
from metaros.interfaces.rcl_interfaces import msg as rcl_interfaces_msg

class Action(Message):
    name: str
    send_goal: Service
    get_result: Service
    cancel_goal: Service
    feedback: Topic
    status: Topic
    def __init__(
        self,
        *,
        name: str = ...,
        send_goal: Service = ...,
        get_result: Service = ...,
        cancel_goal: Service = ...,
        feedback: Topic = ...,
        status: Topic = ...,
    ) -> None: ...

class Clock(Message):
    clock: builtin_interfaces_msg.Time
    def __init__(
        self,
        *,
        clock: builtin_interfaces_msg.Time = ...,
    ) -> None: ...

class Graph(Message):
    nodes: list[Node]
    def __init__(
        self,
        *,
        nodes: list[Node] = ...,
    ) -> None: ...

class InterfaceType(Message):
    name: str
    hash: TypeHash
    def __init__(
        self,
        *,
        name: str = ...,
        hash: TypeHash = ...,
    ) -> None: ...

class Node(Message):
    name: str
    parameters: list[rcl_interfaces_msg.ParameterDescriptor]
    parameter_values: list[rcl_interfaces_msg.ParameterValue]
    publishers: list[Topic]
    subscriptions: list[Topic]
    service_clients: list[Service]
    service_servers: list[Service]
    action_clients: list[Action]
    action_servers: list[Action]
    def __init__(
        self,
        *,
        name: str = ...,
        parameters: list[rcl_interfaces_msg.ParameterDescriptor] = ...,
        parameter_values: list[rcl_interfaces_msg.ParameterValue] = ...,
        publishers: list[Topic] = ...,
        subscriptions: list[Topic] = ...,
        service_clients: list[Service] = ...,
        service_servers: list[Service] = ...,
        action_clients: list[Action] = ...,
        action_servers: list[Action] = ...,
    ) -> None: ...

class QoSProfile(Message):
    HISTORY_SYSTEM_DEFAULT: Final = 0
    HISTORY_KEEP_LAST: Final = 1
    HISTORY_KEEP_ALL: Final = 2
    HISTORY_UNKNOWN: Final = 3
    RELIABILITY_SYSTEM_DEFAULT: Final = 0
    RELIABILITY_RELIABLE: Final = 1
    RELIABILITY_BEST_EFFORT: Final = 2
    RELIABILITY_UNKNOWN: Final = 3
    RELIABILITY_BEST_AVAILABLE: Final = 4
    DURABILITY_SYSTEM_DEFAULT: Final = 0
    DURABILITY_TRANSIENT_LOCAL: Final = 1
    DURABILITY_VOLATILE: Final = 2
    DURABILITY_UNKNOWN: Final = 3
    DURABILITY_BEST_AVAILABLE: Final = 4
    LIVELINESS_SYSTEM_DEFAULT: Final = 0
    LIVELINESS_AUTOMATIC: Final = 1
    LIVELINESS_MANUAL_BY_TOPIC: Final = 3
    LIVELINESS_UNKNOWN: Final = 4
    LIVELINESS_BEST_AVAILABLE: Final = 5
    depth: int
    deadline: builtin_interfaces_msg.Duration
    lifespan: builtin_interfaces_msg.Duration
    history: int
    reliability: int
    durability: int
    liveliness: int
    liveliness_lease_duration: builtin_interfaces_msg.Duration
    def __init__(
        self,
        *,
        depth: int = ...,
        deadline: builtin_interfaces_msg.Duration = ...,
        lifespan: builtin_interfaces_msg.Duration = ...,
        history: int = ...,
        reliability: int = ...,
        durability: int = ...,
        liveliness: int = ...,
        liveliness_lease_duration: builtin_interfaces_msg.Duration = ...,
    ) -> None: ...

class Service(Message):
    name: str
    request_type: InterfaceType
    request_qos: QoSProfile
    response_type: InterfaceType
    response_qos: QoSProfile
    def __init__(
        self,
        *,
        name: str = ...,
        request_type: InterfaceType = ...,
        request_qos: QoSProfile = ...,
        response_type: InterfaceType = ...,
        response_qos: QoSProfile = ...,
    ) -> None: ...

class Topic(Message):
    name: str
    type: InterfaceType
    qos: QoSProfile
    def __init__(
        self,
        *,
        name: str = ...,
        type: InterfaceType = ...,
        qos: QoSProfile = ...,
    ) -> None: ...

class TypeHash(Message):
    version: int
    value: npt.NDArray[np.uint8]
    def __init__(
        self,
        *,
        version: int = ...,
        value: npt.NDArray[Any] | Sequence[int] | bytes | bytearray | memoryview = ...,
    ) -> None: ...
