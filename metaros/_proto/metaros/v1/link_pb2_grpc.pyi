"""Generated from proto/metaros/v1/link.proto by tools/gen_proto.py: do not edit."""

from typing import Any

import grpc
import grpc.aio

class LinkStub:
    def __init__(self, channel: grpc.Channel | grpc.aio.Channel) -> None: ...
    Connect: Any

class LinkServicer:
    def Connect(self, request: Any, context: Any) -> Any: ...

def add_LinkServicer_to_server(servicer: LinkServicer, server: grpc.Server | grpc.aio.Server) -> None: ...
