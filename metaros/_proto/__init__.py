"""Generated from proto/metaros/v1 by tools/gen_proto.py: do not edit."""

from metaros._proto.metaros.v1 import alerts_pb2 as alerts_pb2
from metaros._proto.metaros.v1 import alerts_pb2_grpc as alerts_pb2_grpc
from metaros._proto.metaros.v1 import cluster_pb2 as cluster_pb2
from metaros._proto.metaros.v1 import events_pb2 as events_pb2
from metaros._proto.metaros.v1 import events_pb2_grpc as events_pb2_grpc
from metaros._proto.metaros.v1 import fleet_pb2 as fleet_pb2
from metaros._proto.metaros.v1 import fleet_pb2_grpc as fleet_pb2_grpc
from metaros._proto.metaros.v1 import link_pb2 as link_pb2
from metaros._proto.metaros.v1 import link_pb2_grpc as link_pb2_grpc
from metaros._proto.metaros.v1 import telemetry_pb2 as telemetry_pb2
from metaros._proto.metaros.v1 import telemetry_pb2_grpc as telemetry_pb2_grpc

__all__ = [
    "alerts_pb2",
    "alerts_pb2_grpc",
    "cluster_pb2",
    "events_pb2",
    "events_pb2_grpc",
    "fleet_pb2",
    "fleet_pb2_grpc",
    "link_pb2",
    "link_pb2_grpc",
    "telemetry_pb2",
    "telemetry_pb2_grpc",
]
