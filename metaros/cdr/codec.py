"""`codec(type)`: the compiled encoder and decoder of a type, with errors that name the field."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from metaros.cdr.decoder import DECODE_ERRORS, build_fast_decoder, build_general_decoder
from metaros.cdr.encoder import build_encoder
from metaros.cdr.layout import HEADER_BYTES, Order, check_size
from metaros.cdr.reference import ReferenceDecoder, ReferenceEncoder
from metaros.errors import DecodeError, DefinitionError
from metaros.idl import Catalogue, default_catalogue, type_hash

__all__ = ["Codec", "Readable", "codec", "split_header"]

Readable = bytes | bytearray | memoryview

_LITTLE_HEADER = b"\0\1\0\0"
_ORDERS: dict[bytes, Order] = {b"\0\0": ">", b"\0\1": "<"}


def codec(name_or_class: str | type[Any], catalogue: Catalogue | None = None) -> Codec:
    """The codec of a message type, by full name or by class; compiled when first asked for."""
    if isinstance(name_or_class, str):
        name = name_or_class
    else:
        name = name_or_class.__metaros_name__
        catalogue = catalogue or name_or_class.__metaros_catalogue__
    home = (catalogue or default_catalogue()).home(name)
    return home.memo("codec", name, lambda: Codec(name, home))


class Codec:
    """Messages of one type to CDR bytes and back.

    `encode(message)` gives little-endian XCDR1 with its 4-byte header; `FieldError` names a value that does not fit.
    `decode(data)` takes either byte order; `DecodeError` says what is wrong. Arrays it returns may be read-only views
    of `data`. Text that is not UTF-8 is decoded with replacement characters, as rclpy does.
    """

    __slots__ = ("_catalogue", "_general", "decode", "encode", "hash", "name")

    name: str
    hash: str
    encode: Callable[[Any], bytes]
    decode: Callable[[Readable], Any]

    def __init__(self, name: str, catalogue: Catalogue) -> None:
        catalogue.message(name)
        check_size(name, catalogue)
        self.name = name
        self.hash = type_hash(name, catalogue)
        self._catalogue = catalogue
        self._general: dict[tuple[str, str], Callable[[memoryview], Any]] = {}
        try:
            self.encode = build_encoder(name, catalogue, self._encode_slowly)
            self.decode = build_fast_decoder(name, catalogue, self._decode_slowly)
        except (SyntaxError, RecursionError, MemoryError) as error:
            raise DefinitionError(f"{name} is too complicated: {error}") from None

    def __repr__(self) -> str:
        return f"Codec({self.name!r})"

    def _encode_slowly(self, message: Any) -> bytes:
        encoder = ReferenceEncoder(self._catalogue)
        encoder.message(self._catalogue.message(self.name), message, "")
        return _LITTLE_HEADER + bytes(encoder.body)

    def _decode_slowly(self, data: Readable) -> Any:
        order, body = split_header(data)
        try:
            try:
                return self._decoder(order, "strict")(body)
            except UnicodeDecodeError:
                return self._decoder(order, "replace")(body)
        except DECODE_ERRORS:
            reference = ReferenceDecoder(self._catalogue, body, order=order)
            try:
                reference.message(self._catalogue.message(self.name), "")
                reference.end()
            except DecodeError as error:
                raise DecodeError(f"{self.name}: {error}") from None
            raise DecodeError(f"{self.name}: malformed CDR") from None

    def _decoder(self, order: Order, errors: str) -> Callable[[memoryview], Any]:
        key = (order, errors)
        if key not in self._general:
            self._general[key] = build_general_decoder(self.name, self._catalogue, order=order, errors=errors)
        return self._general[key]


def split_header(data: Readable) -> tuple[Order, memoryview]:
    """The byte order ("<" or ">") and the body of CDR bytes, or `DecodeError`."""
    try:
        view = memoryview(data).cast("B").toreadonly()
    except TypeError:
        raise DecodeError(f"CDR is bytes, not {type(data).__name__}") from None
    if len(view) < HEADER_BYTES:
        raise DecodeError(f"{len(view)} bytes are no CDR: the header alone has {HEADER_BYTES}")
    order = _ORDERS.get(bytes(view[:2]))
    if order is None:
        raise DecodeError(f"the representation {bytes(view[:2]).hex()} is not plain CDR (0000 or 0001)")
    return order, view[HEADER_BYTES:]
