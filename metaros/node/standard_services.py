"""Services that every node offers. Their codecs are compiled at the first request, so that a node starts quickly."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from types import SimpleNamespace
from typing import Any, cast

from metaros.cdr import Codec, codec
from metaros.executor import CallbackGroup
from metaros.idl import message_class
from metaros.node.core import NodeCore
from metaros.node.service import Service
from metaros.wire import QoSProfile

__all__ = ["StandardService", "serve"]


@dataclass(frozen=True, slots=True)
class StandardService:
    """A service below a node's name, with its type's name and hash."""

    name: str
    type_name: str
    type_hash: str


class _LazyCodec:
    """A codec that is compiled when it is first used."""

    def __init__(self, name: str) -> None:
        self._name = name

    def encode(self, message: Any) -> bytes:
        """As `Codec.encode`."""
        return codec(self._name).encode(message)

    def decode(self, data: bytes) -> Any:
        """As `Codec.decode`."""
        return codec(self._name).decode(data)


def serve(
    node: NodeCore,
    service: StandardService,
    callback: Callable[[Any, Any], Any],
    qos: QoSProfile,
    *,
    group: CallbackGroup | None = None,
) -> Service:
    """Offer `<node>/<service>`, answered by `callback(request, response)` on the node's executor."""
    name = service.type_name
    service_type: Any = SimpleNamespace(
        __metaros_name__=name,
        __metaros_hash__=service.type_hash,
        Response=lambda: message_class(f"{name}_Response")(),
    )
    request, response = (cast("Codec", _LazyCodec(f"{name}_{part}")) for part in ("Request", "Response"))
    return Service(
        node, service_type, f"~/{service.name}", callback, request=request, response=response, qos=qos, group=group
    )
