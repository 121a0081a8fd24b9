"""The ROS 2 wire on Zenoh: keys, attachments, tokens, QoS text, the session, the router and the graph."""

from __future__ import annotations

import importlib
from typing import TYPE_CHECKING, Any

from metaros.wire.attachment import Attachment, pack_attachment, parse_attachment
from metaros.wire.gid import gid_of
from metaros.wire.graph import EndpointInfo, Graph, NodeInfo
from metaros.wire.keys import DataKey, parse_key
from metaros.wire.liveliness_tokens import EndpointToken, NodeToken, parse_token
from metaros.wire.names import NO_HASH, dds_name, ros_name
from metaros.wire.qos import (
    INFINITE_NS,
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
    incompatibilities,
    qos_command,
    qos_default,
    qos_parameters,
    qos_reliable_all,
    qos_rosout,
    qos_sensor_data,
    qos_services,
    qos_transient_local,
)
from metaros.wire.session import WireSession, default_endpoint, domain_from

if TYPE_CHECKING:
    from metaros.wire.router import Router, open_router, probe

__all__ = [
    "INFINITE_NS",
    "NO_HASH",
    "Attachment",
    "Congestion",
    "DataKey",
    "Durability",
    "DurabilityPolicy",
    "EndpointInfo",
    "EndpointToken",
    "Graph",
    "History",
    "HistoryPolicy",
    "Liveliness",
    "LivelinessPolicy",
    "NodeInfo",
    "NodeToken",
    "Priority",
    "QoSDurabilityPolicy",
    "QoSHistoryPolicy",
    "QoSLivelinessPolicy",
    "QoSProfile",
    "QoSReliabilityPolicy",
    "Reliability",
    "ReliabilityPolicy",
    "Router",
    "WireSession",
    "dds_name",
    "default_endpoint",
    "domain_from",
    "gid_of",
    "incompatibilities",
    "open_router",
    "pack_attachment",
    "parse_attachment",
    "parse_key",
    "parse_token",
    "probe",
    "qos_command",
    "qos_default",
    "qos_parameters",
    "qos_reliable_all",
    "qos_rosout",
    "qos_sensor_data",
    "qos_services",
    "qos_transient_local",
    "ros_name",
]


def __getattr__(name: str) -> Any:
    if name not in ("Router", "open_router", "probe"):  # only the programs that host a router load it
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    return getattr(importlib.import_module("metaros.wire.router"), name)
