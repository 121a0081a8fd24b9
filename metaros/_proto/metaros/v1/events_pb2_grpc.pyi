"""Generated from proto/metaros/v1/events.proto by tools/gen_proto.py: do not edit."""

from typing import Any

import grpc
import grpc.aio

class EventServiceStub:
    def __init__(self, channel: grpc.Channel | grpc.aio.Channel) -> None: ...
    ListEvents: Any
    WatchEvents: Any

class EventServiceServicer:
    def ListEvents(self, request: Any, context: Any) -> Any: ...
    def WatchEvents(self, request: Any, context: Any) -> Any: ...

def add_EventServiceServicer_to_server(servicer: EventServiceServicer, server: grpc.Server | grpc.aio.Server) -> None: ...
