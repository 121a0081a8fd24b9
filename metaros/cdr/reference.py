"""The codec written for clarity: it walks the definition field by field and says which one is wrong.

`Codec` falls back to it when the compiled functions refuse a value, and the tests compare the two.
"""

from __future__ import annotations

import struct
from typing import TYPE_CHECKING, Any

from metaros.cdr.layout import CODES, Order, size_of
from metaros.cdr.wide import decode_wide, encode_wide
from metaros.errors import DecodeError, FieldError
from metaros.idl import Catalogue, FieldType, MessageDefinition, message_class
from metaros.idl.arrays import DTYPES, as_array
from metaros.idl.definitions import INTEGER_RANGES
from metaros.lazy_import import LazyModule

if TYPE_CHECKING:
    import numpy as np
else:
    np = LazyModule("numpy")

__all__ = ["ReferenceDecoder", "ReferenceEncoder"]


class ReferenceEncoder:
    """Appends values to a body; `FieldError` names the path of a value that does not fit."""

    def __init__(self, catalogue: Catalogue, *, order: Order = "<") -> None:
        self.catalogue = catalogue
        self.order = order
        self.body = bytearray()

    def message(self, definition: MessageDefinition, value: Any, path: str) -> None:
        """Append a message; `path` is where it is in the whole one."""
        if not definition.fields:
            self.body += b"\0"
        for field in definition.fields:
            where = f"{path}.{field.name}" if path else field.name
            if not hasattr(value, field.attribute):
                raise FieldError(f"{where}: expected a {definition.name}, got {_kind(value)}")
            self.value(field.type, getattr(value, field.attribute), where)

    def value(self, kind: FieldType, value: Any, path: str) -> None:
        """Append one field."""
        if kind.array:
            self._array(kind, value, path)
        elif kind.is_nested:
            self.message(self.catalogue.message(kind.base), value, path)
        elif kind.is_string:
            self._string(kind, value, path)
        else:
            self._scalar(kind.base, value, path)

    def _array(self, kind: FieldType, value: Any, path: str) -> None:
        if kind.base in DTYPES:
            try:
                value = as_array(value, kind.base)
            except FieldError as error:
                raise FieldError(f"{path}: {error}") from None
            count = value.size
        elif isinstance(value, (list, tuple)):
            count = len(value)
        else:
            raise FieldError(f"{path}: expected a list, got {_kind(value)}")
        if kind.array == "fixed" and count != kind.capacity:
            raise FieldError(f"{path}: {count} elements, exactly {kind.capacity} are needed")
        if kind.array == "bounded" and count > kind.capacity:
            raise FieldError(f"{path}: {count} elements, at most {kind.capacity} are allowed")
        if kind.is_sequence:
            self._scalar("uint32", count, path)
        if kind.base not in DTYPES:
            for index, item in enumerate(value):
                self.value(kind.element, item, f"{path}[{index}]")
        elif count:
            self._align(size_of(kind.base))
            self.body += value.astype(value.dtype.newbyteorder(self.order)).tobytes()

    def _string(self, kind: FieldType, value: Any, path: str) -> None:
        if not isinstance(value, str):
            raise FieldError(f"{path}: expected a str, got {_kind(value)}")
        try:
            data = value.encode() if kind.base == "string" else encode_wide(value, self.order)
        except UnicodeEncodeError as error:
            raise FieldError(f"{path}: text that cannot be encoded: {error.reason}") from None
        size = len(data) if kind.base == "string" else len(data) // 4
        if kind.string_bound and size > kind.string_bound:
            raise FieldError(f"{path}: {size} characters, at most {kind.string_bound} are allowed")
        self._scalar("uint32", size + (kind.base == "string"), path)
        self.body += data + (b"\0" if kind.base == "string" else b"")

    def _scalar(self, base: str, value: Any, path: str) -> None:
        self._align(size_of(base))
        if base == "byte" and isinstance(value, (bytes, bytearray)) and len(value) == 1:
            value = value[0]  # as ROS 2 programs hold it
        try:
            self.body += struct.pack(self.order + CODES[base], value)
        except (struct.error, OverflowError, TypeError, ValueError) as error:
            if base in INTEGER_RANGES and hasattr(value, "__index__"):
                low, high = INTEGER_RANGES[base]
                raise FieldError(f"{path}: {int(value)} does not fit {base} ({low} to {high})") from None
            if isinstance(error, OverflowError):
                raise FieldError(f"{path}: {value!r} does not fit {base}") from None
            raise FieldError(f"{path}: expected a {base}, got {_kind(value)}") from None

    def _align(self, size: int) -> None:
        self.body += bytes(-len(self.body) % size)


class ReferenceDecoder:
    """Reads values from a body; `DecodeError` names the path where it ends or makes no sense."""

    def __init__(self, catalogue: Catalogue, body: memoryview, *, order: Order) -> None:
        self.catalogue = catalogue
        self.body = body
        self.order = order
        self.at = 0

    def message(self, definition: MessageDefinition, path: str) -> Any:
        """Read a message."""
        cls = message_class(definition.name, self.catalogue)
        found = object.__new__(cls)
        if not definition.fields:
            self._take(1, path)
        for field in definition.fields:
            where = f"{path}.{field.name}" if path else field.name
            setattr(found, field.attribute, self.value(field.type, where))
        return found

    def value(self, kind: FieldType, path: str) -> Any:
        """Read one field."""
        if kind.array:
            return self._array(kind, path)
        if kind.is_nested:
            return self.message(self.catalogue.message(kind.base), path)
        if kind.is_string:
            return self._string(kind, path)
        return self._scalar(kind.base, path)

    def end(self) -> None:
        """Check that nothing but padding follows."""
        rest = len(self.body) - self.at
        if rest > 3:
            raise DecodeError(f"{rest} bytes too many after the last field")

    def _array(self, kind: FieldType, path: str) -> Any:
        count = kind.capacity if kind.array == "fixed" else int(self._scalar("uint32", path))
        if kind.array == "bounded" and count > kind.capacity:
            raise DecodeError(f"{path}: {count} elements, at most {kind.capacity} are allowed")
        if kind.base in DTYPES:
            return self._numbers(kind.base, count, path)
        if count > len(self.body):
            raise DecodeError(f"{path}: {count} elements in a message of {len(self.body)} bytes")
        return [self.value(kind.element, f"{path}[{index}]") for index in range(count)]

    def _numbers(self, base: str, count: int, path: str) -> Any:
        size = size_of(base)
        if count:
            self._align(size)
        data = self._take(count * size, path)
        dtype = np.dtype(np.uint8) if base == "bool" else DTYPES[base]
        return np.frombuffer(data, dtype.newbyteorder(self.order), count).astype(DTYPES[base])

    def _string(self, kind: FieldType, path: str) -> str:
        size = int(self._scalar("uint32", path))
        if kind.string_bound and size > kind.string_bound + (kind.base == "string"):
            raise DecodeError(f"{path}: a string of {size} characters, at most {kind.string_bound} are allowed")
        if kind.base == "wstring":
            try:
                return decode_wide(self._take(4 * size, path), 0, size, self.order, "replace")
            except ValueError as error:
                raise DecodeError(f"{path}: {error}") from None
        data = bytes(self._take(size, path))
        if data[-1:] not in (b"", b"\0"):
            raise DecodeError(f"{path}: a string that does not end with NUL")
        return str(data[:-1], "utf-8", "replace")

    def _scalar(self, base: str, path: str) -> Any:
        self._align(size_of(base))
        return struct.unpack(self.order + CODES[base], self._take(size_of(base), path))[0]

    def _align(self, size: int) -> None:
        self.at += -self.at % size

    def _take(self, size: int, path: str) -> memoryview:
        if self.at + size > len(self.body):
            left = max(0, len(self.body) - self.at)
            raise DecodeError(f"{path or 'the message'}: {size} bytes needed at offset {self.at}, {left} are left")
        taken = self.body[self.at : self.at + size]
        self.at += size
        return taken


def _kind(value: Any) -> str:
    return type(value).__name__
