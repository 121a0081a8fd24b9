"""Types for what clients send as JSON: from the shipped catalogue, else from what the robot announced."""

from __future__ import annotations

from typing import Any

from gateway.domain.channel import Channel
from gateway.errors import InvalidRequestError
from gateway.fleet.ros.shapes import shape_of
from metaros.cdr import codec
from metaros.cdr.layout import check_size, least_bytes
from metaros.errors import TypeHashError
from metaros.idl import Catalogue, add_schema_text, default_catalogue, message_class, type_hash
from metaros.idl.json import from_json, to_json
from metaros.limits import LIMITS

__all__ = ["TypeRegistry", "full_type_name"]

MAX_CATALOGUES = 256


def full_type_name(name: str, kind: str) -> str:
    """ "std_msgs/String" as "std_msgs/msg/String"; `kind` is msg or srv."""
    parts = name.split("/")
    if len(parts) == 2 and all(parts):
        return f"{parts[0]}/{kind}/{parts[1]}"
    if len(parts) == 3 and parts[1] == kind and all(parts):
        return name
    raise InvalidRequestError(f"type {name[:80]!r} is not of the form package/{kind}/Name")


class TypeRegistry:
    """Encodes and decodes by type name; keeps one catalogue per announced schema, a bounded number of them."""

    def __init__(self) -> None:
        self._learned: dict[tuple[str, str], Catalogue] = {}

    def encode(
        self, name: str, value: Any, channel: Channel | None = None, known: Catalogue | None = None
    ) -> tuple[bytes, str]:
        """(CDR, type hash) of a JSON-able message; FieldError names what does not fit.

        `known` is where the type is defined if no channel says so.
        """
        catalogue = self._catalogue(name, channel, known)
        check_size(name, catalogue)
        if least_bytes(name, catalogue) > LIMITS.frame_bytes:  # a robot may announce what it likes
            raise InvalidRequestError(f"every message of type {name[:80]} is too large to be sent")
        payload = codec(name, catalogue).encode(from_json(message_class(name, catalogue), value))
        if len(payload) > LIMITS.frame_bytes // 2:
            raise InvalidRequestError(f"the message has {len(payload)} bytes, at most {LIMITS.frame_bytes // 2} may go")
        return payload, self.hash_of(name, channel, known)

    def decode(self, name: str, payload: bytes) -> Any:
        """A message as JSON-able values."""
        return to_json(codec(name, default_catalogue()).decode(payload))

    def hash_of(self, name: str, channel: Channel | None = None, known: Catalogue | None = None) -> str:
        """The type's hash; TypeHashError when the robot announced another one for that name."""
        mine = type_hash(name, self._catalogue(name, channel, known))
        if channel is not None and channel.schema_name == name and channel.type_hash not in ("", mine):
            raise TypeHashError(f"the robot's {name} has hash {channel.type_hash}, ours {mine}: their fields differ")
        return mine

    def shape(self, name: str, channel: Channel | None = None, known: Catalogue | None = None) -> dict[str, Any]:
        """What a type is made of, see `shape_of`."""
        return shape_of(name, self._catalogue(name, channel, known))

    def _catalogue(self, name: str, channel: Channel | None, known: Catalogue | None) -> Catalogue:
        shipped = default_catalogue()
        announced = channel is not None and channel.schema_name == name and channel.schema_encoding == "ros2msg"
        if channel is None or not announced or (name in shipped and type_hash(name, shipped) == channel.type_hash):
            return shipped if announced or known is None else known
        key = (name, channel.type_hash)
        catalogue = self._learned.get(key)
        if catalogue is None:
            catalogue = Catalogue()
            add_schema_text(name, channel.schema.decode("utf-8", "replace"), catalogue)
            if len(self._learned) >= MAX_CATALOGUES:
                del self._learned[next(iter(self._learned))]
            self._learned[key] = catalogue
        return catalogue
