"""DDS types of ROS 2 interfaces, whose samples stay the bytes that they are.

Cyclone DDS's Python would turn every sample into objects, 64 KiB of an image in a millisecond. Here a type has the
fields of the interface, so that peers can check it, but a sample is its CDR, which is the same on Zenoh.
"""

from __future__ import annotations

from typing import Any, Final

from cyclonedds.idl import make_idl_struct
from cyclonedds.idl import types as _types

from metaros.dds.names import dds_type
from metaros.errors import UsageError
from metaros.idl import Catalogue, FieldType, MessageDefinition

__all__ = ["RawSample", "make_sample", "message_type", "with_header"]

types: Any = _types  # which builds its types by indexing

_BASES: Final[dict[str, Any]] = {
    "bool": bool,
    "byte": types.byte,
    "char": types.uint8,
    **{name: getattr(types, name) for size in (8, 16, 32, 64) for name in (f"int{size}", f"uint{size}")},
    "float32": types.float32,
    "float64": types.float64,
    "string": str,
}
_MOST: Final = 65535  # elements of a bounded sequence that cyclonedds can state
_PADDING: Final = 3  # the bits of the header's last byte that say how many bytes of padding follow
_HEADER_FIELDS: Final[dict[str, Any]] = {"client_guid": types.uint64, "sequence_number": types.int64}

RawSample = Any  # an instance of one of these types; `cdr` has its bytes, header included


def message_type(name: str, catalogue: Catalogue, *, header: bool = False) -> type[Any]:
    """The DDS type of a message, or of a service's half; with `header`, as Cyclone's rmw sends requests and replies.

    UsageError where DDS's Python has no such type: wide strings.
    """
    kind = "dds header" if header else "dds"
    return catalogue.home(name).memo(kind, name, lambda: _make(name, catalogue, header=header, raw=True))


def make_sample(kind: type[Any], cdr: bytes) -> RawSample:
    """A sample of these bytes."""
    sample = object.__new__(kind)
    sample.cdr = cdr
    return sample


def with_header(cdr: bytes, header: bytes) -> bytes:
    """Put 16 bytes between the CDR's own header and its body: they keep the alignment of what follows."""
    return cdr[:4] + header + cdr[4:]


def _make(name: str, catalogue: Catalogue, *, header: bool, raw: bool) -> type[Any]:
    definition = catalogue.message(name)
    fields = dict(_HEADER_FIELDS) if header else {}
    fields |= _fields(definition, catalogue)
    made: Any = make_idl_struct(name.rpartition("/")[2], dds_type(name), fields, dataclassify=not raw)
    if raw:
        made.serialize = _serialize
        made.deserialize = classmethod(_deserialize)
    found: type[Any] = made
    return found


def _fields(definition: MessageDefinition, catalogue: Catalogue) -> dict[str, Any]:
    if not definition.fields:
        return {"structure_needs_at_least_one_member": types.uint8}
    return {field.name: _array(field.type, catalogue) for field in definition.fields}


def _array(kind: FieldType, catalogue: Catalogue) -> Any:
    element = _element(kind, catalogue)
    if kind.array == "fixed":
        return types.array[element, kind.capacity]
    if kind.array == "bounded" and kind.capacity <= _MOST:
        return types.sequence[element, kind.capacity]
    return types.sequence[element] if kind.array else element


def _element(kind: FieldType, catalogue: Catalogue) -> Any:
    if kind.is_nested:
        home = catalogue.home(kind.base)
        return home.memo("dds part", kind.base, lambda: _make(kind.base, catalogue, header=False, raw=False))
    if kind.base not in _BASES:
        raise UsageError(f"DDS's Python has no {kind.base}: such types are not bridged")
    return types.bounded_str[kind.string_bound] if kind.string_bound else _BASES[kind.base]


def _serialize(sample: Any, **_: object) -> bytes:
    cdr: bytes = sample.cdr
    return cdr


def _deserialize(kind: type[Any], data: bytes, /, **_: object) -> RawSample:
    """The bytes without DDS's padding, which ROS's CDR on Zenoh does not have."""
    padding = data[3] & _PADDING
    end = len(data) - padding if padding else len(data)
    return make_sample(kind, data[:2] + b"\0\0" + data[4:end])
