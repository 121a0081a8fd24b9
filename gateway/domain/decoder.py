"""Messages as JSON-able values, live or stored, decoded by the types their robots announced."""

from __future__ import annotations

from collections import OrderedDict
from collections.abc import Callable
from typing import Any

from gateway.domain.channel import Channel
from metaros.cdr import codec
from metaros.errors import MetarosError, SealedError, TooLargeError, TypeHashError, UnknownTypeError
from metaros.idl import Catalogue, add_schema_text, default_catalogue, type_hash
from metaros.idl.json import to_json
from metaros.limits import LIMITS

__all__ = ["Decoder"]

MAX_CATALOGUES = 256
SEALED = "sealed/"  # a channel's encoding begins so where its payloads are encrypted


class Decoder:
    """Used by one thread. Keeps a bounded number of the catalogues that announced schemas make."""

    def __init__(self) -> None:
        self._learned: OrderedDict[tuple[str, bytes], Catalogue] = OrderedDict()
        # By the id of the channel that is held beside it: a channel's hash takes longer than many a message.
        self._readers: dict[int, tuple[Channel, Callable[[bytes | memoryview], Any]]] = {}

    def reader(self, channel: Channel) -> Callable[[bytes | memoryview], Any]:
        """What makes messages of a channel's payloads, found once for all of them.

        Raises:
            SealedError: nobody but the holder of its key can read it.
            UnknownTypeError, TypeHashError: its robot did not send the definition.
        """
        found = self._readers.get(id(channel))
        if found is not None:
            return found[1]
        reader: Callable[[bytes | memoryview], Any] = codec(channel.schema_name, self.types_of(channel)).decode
        if len(self._readers) >= MAX_CATALOGUES:
            del self._readers[next(iter(self._readers))]
        self._readers[id(channel)] = channel, reader
        return reader

    def types_of(self, channel: Channel) -> Catalogue:
        """Where a channel's type is defined; raises as `reader` does."""
        if channel.encoding.startswith(SEALED):
            raise SealedError(f"{channel.topic} is sealed: only who has its key can read it")
        if channel.encoding != "cdr":
            raise UnknownTypeError(f"{channel.topic} has encoding {channel.encoding[:40]!r}, which is not decoded here")
        return self._catalogue(channel)

    def decode(self, channel: Channel, payload: bytes) -> Any:
        """The message; MetarosError when it is too large to show, of an unknown type, or not of its type."""
        reader = self.reader(channel)
        if len(payload) > LIMITS.history_decoded_bytes:
            raise TooLargeError(f"{len(payload)} bytes are not shown as JSON, at most {LIMITS.history_decoded_bytes}")
        return to_json(reader(payload))

    def view(self, channel: Channel, payload: bytes) -> dict[str, Any]:
        """The keys of an answer for a message: `message`, and `error` where there is none."""
        try:
            return {"message": self.decode(channel, payload)}
        except MetarosError as error:
            return {"message": None, "error": {"code": error.code, "message": str(error)[:500]}}

    def _catalogue(self, channel: Channel) -> Catalogue:
        name, shipped = channel.schema_name, default_catalogue()
        if name in shipped and channel.type_hash in ("", type_hash(name, shipped)):
            return shipped
        if channel.schema_encoding != "ros2msg" or not channel.schema:
            if name in shipped:
                raise TypeHashError(f"the robot's {name} has hash {channel.type_hash}, and its fields are not known")
            raise UnknownTypeError(f"{name}: its robot announced no definition, and the library ships none")
        key = (name, channel.schema)
        catalogue = self._learned.get(key)
        if catalogue is None:
            catalogue = Catalogue()
            add_schema_text(name, channel.schema.decode("utf-8", "replace"), catalogue)
            self._learned[key] = catalogue
            if len(self._learned) > MAX_CATALOGUES:
                self._learned.popitem(last=False)
        else:
            self._learned.move_to_end(key)
        return catalogue
