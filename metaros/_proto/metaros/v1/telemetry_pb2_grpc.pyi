"""Generated from proto/metaros/v1/telemetry.proto by tools/gen_proto.py: do not edit."""

from typing import Any

import grpc
import grpc.aio

class TelemetryServiceStub:
    def __init__(self, channel: grpc.Channel | grpc.aio.Channel) -> None: ...
    Publish: Any
    CallService: Any

class TelemetryServiceServicer:
    def Publish(self, request: Any, context: Any) -> Any: ...
    def CallService(self, request: Any, context: Any) -> Any: ...

def add_TelemetryServiceServicer_to_server(servicer: TelemetryServiceServicer, server: grpc.Server | grpc.aio.Server) -> None: ...
