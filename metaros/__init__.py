"""Meta-ROS: robot nodes in Python on the ROS 2 wire. `import metaros` is the whole everyday API.

Names load when first used, so that a program that needs only `metaros.idl` never loads Zenoh.
"""

from __future__ import annotations

import importlib

TYPE_CHECKING = False  # `typing` itself is not loaded for it: a function's worker starts with this module
if TYPE_CHECKING:
    from typing import Any

    from metaros import convert, errors
    from metaros.executor import (
        AsyncioExecutor,
        FairExecutor,
        MultiThreadedExecutor,
        MutuallyExclusiveCallbackGroup,
        ReentrantCallbackGroup,
        SingleThreadedExecutor,
    )
    from metaros.idl.annotated import message
    from metaros.idl.annotated_service import action, service
    from metaros.idl.marks import (
        Bounded,
        Exact,
        Fixed,
        Shape,
        byte,
        char,
        float32,
        float64,
        int8,
        int16,
        int32,
        int64,
        uint8,
        uint16,
        uint32,
        uint64,
        wstring,
    )
    from metaros.node import Context, MessageInfo, Node, PublisherEvents, SubscriptionEvents, spin
    from metaros.node.lifecycle import LifecycleNode
    from metaros.wire import (
        Congestion,
        Durability,
        DurabilityPolicy,
        History,
        HistoryPolicy,
        Liveliness,
        LivelinessPolicy,
        Priority,
        QoSDurabilityPolicy,
        QoSHistoryPolicy,
        QoSLivelinessPolicy,
        QoSProfile,
        QoSReliabilityPolicy,
        Reliability,
        ReliabilityPolicy,
        qos_command,
        qos_default,
        qos_reliable_all,
        qos_rosout,
        qos_sensor_data,
        qos_services,
        qos_transient_local,
    )

__version__ = "2.0.0.dev1"

__all__ = [
    "AsyncioExecutor",
    "Bounded",
    "Congestion",
    "Context",
    "Durability",
    "DurabilityPolicy",
    "Exact",
    "FairExecutor",
    "Fixed",
    "History",
    "HistoryPolicy",
    "LifecycleNode",
    "Liveliness",
    "LivelinessPolicy",
    "MessageInfo",
    "MultiThreadedExecutor",
    "MutuallyExclusiveCallbackGroup",
    "Node",
    "Priority",
    "PublisherEvents",
    "QoSDurabilityPolicy",
    "QoSHistoryPolicy",
    "QoSLivelinessPolicy",
    "QoSProfile",
    "QoSReliabilityPolicy",
    "ReentrantCallbackGroup",
    "Reliability",
    "ReliabilityPolicy",
    "Shape",
    "SingleThreadedExecutor",
    "SubscriptionEvents",
    "action",
    "byte",
    "char",
    "convert",
    "errors",
    "float32",
    "float64",
    "int8",
    "int16",
    "int32",
    "int64",
    "message",
    "qos_command",
    "qos_default",
    "qos_reliable_all",
    "qos_rosout",
    "qos_sensor_data",
    "qos_services",
    "qos_transient_local",
    "service",
    "spin",
    "uint8",
    "uint16",
    "uint32",
    "uint64",
    "wstring",
]

_HOMES = {
    "metaros.convert": ("convert",),
    "metaros.errors": ("errors",),
    "metaros.executor": (
        "AsyncioExecutor",
        "FairExecutor",
        "MultiThreadedExecutor",
        "MutuallyExclusiveCallbackGroup",
        "ReentrantCallbackGroup",
        "SingleThreadedExecutor",
    ),
    "metaros.idl.annotated": ("message",),
    "metaros.idl.annotated_service": ("action", "service"),
    "metaros.idl.marks": (
        "Bounded",
        "Exact",
        "Fixed",
        "Shape",
        "byte",
        "char",
        "float32",
        "float64",
        "int8",
        "int16",
        "int32",
        "int64",
        "uint8",
        "uint16",
        "uint32",
        "uint64",
        "wstring",
    ),
    "metaros.node": ("Context", "MessageInfo", "Node", "PublisherEvents", "SubscriptionEvents", "spin"),
    "metaros.node.lifecycle": ("LifecycleNode",),
    "metaros.wire": (
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
        "qos_command",
        "qos_default",
        "qos_reliable_all",
        "qos_rosout",
        "qos_sensor_data",
        "qos_services",
        "qos_transient_local",
    ),
}
_HOME = {name: home for home, names in _HOMES.items() for name in names}


def __getattr__(name: str) -> Any:
    home = _HOME.get(name)
    if home is None:
        raise AttributeError(f"module 'metaros' has no attribute {name!r}")
    module = importlib.import_module(home)
    return module if home == f"metaros.{name}" else getattr(module, name)


def __dir__() -> list[str]:
    return sorted({*globals(), *__all__})
