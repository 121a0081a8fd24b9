"""Generate the decoder of a type: one Python function that unpacks runs of fields straight into new objects.

Two shapes. The fast one takes little-endian `bytes`; the general one takes a memoryview of the body in either byte
order. Neither explains what is wrong: they raise some built-in error, and `Codec` finds out more.
"""

from __future__ import annotations

import struct
from collections.abc import Callable
from typing import TYPE_CHECKING, Any

from metaros.cdr.cursor import Cursor
from metaros.cdr.layout import HEADER_BYTES, Order, size_of
from metaros.cdr.layout import Position as Known
from metaros.cdr.wide import decode_wide
from metaros.idl import Catalogue, Field, FieldType, MessageDefinition, message_class
from metaros.idl.arrays import DTYPES
from metaros.lazy_import import LazyModule

if TYPE_CHECKING:
    import numpy as np
else:
    np = LazyModule("numpy")

__all__ = ["DECODE_ERRORS", "build_fast_decoder", "build_general_decoder"]

DECODE_ERRORS = (ValueError, IndexError, OverflowError, MemoryError, struct.error)
_INLINE_ARRAY_BYTES = 512
_SLICE_BYTES = 65536  # bodies up to this size are copied once if that makes 8-byte elements aligned


def build_fast_decoder(name: str, catalogue: Catalogue, other: Callable[[Any], Any]) -> Callable[[Any], Any]:
    """A function from CDR bytes to a message; what it cannot handle it passes to `other`."""
    aligned = _has_wide_sequence(name, catalogue)
    decoder = _Decoder(catalogue, base=0 if aligned else HEADER_BYTES)
    decoder.scope |= {"_other": other}
    if aligned:
        head = [
            "def function(data):",
            f"  if type(data) is not bytes or len(data) > {_SLICE_BYTES}: return _other(data)",
            "  try:",
            "    if data[1] != 1 or data[0]: return _other(data)",
            "    b = data[4:]",
        ]
    else:
        head = ["def function(b):", "  if type(b) is not bytes: return _other(b)", "  try:"]
    data = "data" if aligned else "b"
    return decoder.build(catalogue.message(name), head, [f"  except _errors: return _other({data})"])


def build_general_decoder(name: str, catalogue: Catalogue, *, order: Order, errors: str) -> Callable[[memoryview], Any]:
    """A function from the body (without header) to a message; `errors` is how text that is not UTF-8 is taken."""
    decoder = _Decoder(catalogue, base=0, order=order, general=True)
    decoder.scope |= {"_frombuffer": _reader(order), "_fixed": _reader(order), "_mode": errors, "_str": str}
    return decoder.build(catalogue.message(name), ["def function(b):", "  if True:"], [])


class _Decoder(Cursor):
    def __init__(self, catalogue: Catalogue, *, base: int, order: Order = "<", general: bool = False) -> None:
        super().__init__(catalogue, base=base, order=order)
        self.general = general
        self.classes: dict[str, str] = {}  # the constant of each message class
        self.after: list[str] = []  # lines that need the run unpacked

    def build(self, definition: MessageDefinition, head: list[str], tail: list[str]) -> Callable[[Any], Any]:
        if self.base:
            self.run += ["H", "2x"]
            self.start = 0
            self.targets.append("h")
            self.after.append("if h != 256: return _other(b)")
        self.new(definition.name, "m")
        self.message(definition, "m")
        self.flush()
        self.line(f"if len(b) - ({self.here()}) > 3: raise _bad()")
        self.line("return m")
        self.scope |= {"_new": object.__new__, "_errors": DECODE_ERRORS, "_bad": ValueError}
        self.scope |= {"_wide": decode_wide, "_bools": _bools}
        return self.compile(definition.name, head, tail)

    def new(self, name: str, variable: str) -> None:
        cls = self.classes.setdefault(name, f"_C{len(self.classes)}")
        self.scope[cls] = message_class(name, self.catalogue)
        self.line(f"{variable} = _new({cls})")

    def message(self, definition: MessageDefinition, target: str) -> None:
        if not definition.fields:
            self.run.append("1x")
            self.advance(1)
        for field in definition.fields:
            self.field(field, f"{target}.{self.catalogue.shape.store(field)}")

    def field(self, field: Field, target: str) -> None:
        kind = field.type
        if kind.array and kind.base in DTYPES:
            self.numbers(kind, target)
        elif kind.array:
            self.elements(kind, target)
        else:
            self.single(kind, target)

    def single(self, kind: FieldType, target: str) -> None:
        if kind.is_nested:
            name = self.fresh("m")
            self.new(kind.base, name)
            self.line(f"{target} = {name}")
            self.message(self.catalogue.message(kind.base), name)
        elif kind.is_string:
            self.string(kind, target)
        else:
            self.unpack(self.code(kind.base), size_of(kind.base), target)

    def string(self, kind: FieldType, target: str) -> None:
        count = self.fresh("n")
        self.unpack("I", 4, count)
        self.flush()
        if kind.string_bound:
            self.line(f"if {count} > {kind.string_bound + (kind.base == 'string')}: raise _bad()")
        if kind.base == "wstring":
            errors = "_mode" if self.general else "'strict'"
            self.line(f"{target} = _wide(b, {self.here()}, {count}, {self.order!r}, {errors})")
            self.move(f"{self.here()} + 4 * {count}", Known(4, 0))
            return
        self.line(f"q = {self.here(-1)} + {count}")
        piece = f"b[{self.here()}:q]"
        self.line(f"{target} = _str({piece}, 'utf-8', _mode)" if self.general else f"{target} = {piece}.decode()")
        self.line("if b[q]: raise _bad()")
        self.move("q + 1", Known(1, 0))

    def numbers(self, kind: FieldType, target: str) -> None:
        size = size_of(kind.base)
        if not self.general:
            self.scope |= {"_frombuffer": np.frombuffer, "_fixed": np.frombuffer}
        dtype = self.constant(f"_{DTYPES[kind.base].name}", DTYPES[kind.base if kind.base != "bool" else "uint8"])
        if kind.array == "fixed":
            self.fixed_numbers(kind, dtype, target)
            return
        count = self.fresh("n")
        self.unpack("I", 4, count)
        self.flush()
        if kind.capacity:
            self.line(f"if {count} > {kind.capacity}: raise _bad()")
        self.move(self.here(), self.position)
        empty = self.constant(f"_empty_{DTYPES[kind.base].name}", _empty(kind.base))
        self.line(f"if {count}:")
        self.indent += 1
        if size == 8 and self.position.gap(8) != 0:
            self.line(f"p = {self.rounded(8)}")
        read = f"_frombuffer(b, {dtype}, {count}, p)"
        self.line(f"{target} = {f'_bools({read})' if kind.base == 'bool' else read}")
        self.line(f"p += {count} * {size}" if size > 1 else f"p += {count}")
        self.indent -= 1
        self.line(f"else: {target} = {empty}")
        self.position = Known(min(size, 4), 0)

    def fixed_numbers(self, kind: FieldType, dtype: str, target: str) -> None:
        size = size_of(kind.base)
        total = size * kind.capacity
        self.align(size)
        if total <= _INLINE_ARRAY_BYTES:
            name = self.fresh("a")
            self.add(f"{total}s", total, name)
            read = f"_fixed({name}, {dtype})"
        else:
            self.flush()
            read = f"_frombuffer(b, {dtype}, {kind.capacity}, {self.here()})"
            self.skip(total)
        read = f"_bools({read})" if kind.base == "bool" else read
        if self.run:
            self.after.append(f"{target} = {read}")
        else:
            self.line(f"{target} = {read}")

    def elements(self, kind: FieldType, target: str) -> None:
        count = str(kind.capacity)
        if kind.is_sequence:
            count = self.fresh("n")
            self.unpack("I", 4, count)
        self.flush()
        if kind.array == "bounded":
            self.line(f"if {count} > {kind.capacity}: raise _bad()")
        items, element = self.fresh("v"), self.fresh("e")
        self.line(f"{target} = {items} = []")
        self.line(f"if {count} > len(b): raise _bad()")
        self.move(self.here(), self.position)
        self.repeat(f"for _ in range({count}):", lambda: self.element(kind.element, items, element))

    def element(self, kind: FieldType, items: str, name: str) -> None:
        self.offset = self.start = 0
        if kind.is_nested:
            self.new(kind.base, name)
            self.message(self.catalogue.message(kind.base), name)
        else:
            self.string(kind, name)
        self.flush()
        self.line(f"{items}.append({name})")
        self.move(self.here(), self.position)

    def unpack(self, code: str, size: int, target: str) -> None:
        self.align(size)
        self.add(code, size, target)

    def flush(self) -> None:
        super().flush()
        for line in self.after:
            self.line(line)
        self.after = []


def _has_wide_sequence(name: str, catalogue: Catalogue) -> bool:
    """Whether the type has numeric arrays of 8-byte elements outside runs, which want an aligned body."""
    for part in (name, *catalogue.dependencies(name)):
        for field in catalogue.message(part).fields:
            kind = field.type
            wide = kind.array and kind.base in DTYPES and size_of(kind.base) == 8
            if wide and (kind.is_sequence or 8 * kind.capacity > _INLINE_ARRAY_BYTES):
                return True
    return False


def _reader(order: Order) -> Callable[..., Any]:
    def read(data: Any, dtype: np.dtype[Any], count: int = -1, offset: int = 0) -> Any:
        values = np.frombuffer(data, dtype.newbyteorder(order), count, offset)
        return values if values.dtype == dtype and values.flags.aligned else values.astype(dtype)

    return read


def _empty(base: str) -> Any:
    values = np.empty(0, DTYPES[base])
    values.flags.writeable = False
    return values


def _bools(values: Any) -> Any:
    """Bytes as booleans; anything but zero is true."""
    return values.view(np.bool_) if int(values.max()) <= 1 else values != 0
