"""Generate the encoder of a type: one Python function that packs runs of fields with one `Struct` each.

The function only knows good input; anything else raises some built-in error, whereupon `Codec` lets the slow
reference encoder either cope or name the field.
"""

from __future__ import annotations

import struct
from array import array as array_type
from collections.abc import Callable
from typing import TYPE_CHECKING, Any

from metaros.cdr.layout import Position, size_of
from metaros.cdr.source import Source
from metaros.cdr.wide import encode_wide
from metaros.errors import FieldError
from metaros.idl import Catalogue, Field, MessageDefinition
from metaros.idl.arrays import DTYPES, TYPE_CODES, as_view
from metaros.lazy_import import LazyModule

if TYPE_CHECKING:
    import numpy as np
else:
    np = LazyModule("numpy")

__all__ = ["build_encoder"]

_INLINE_ARRAY_BYTES = 512  # fixed arrays up to this size are part of the run, larger ones are joined without a copy
_ENCODE_ERRORS = (AttributeError, TypeError, ValueError, OverflowError, BufferError, struct.error, FieldError)
_LITTLE_ENDIAN = "256"  # the header 00 01 00 00 as a little-endian uint32


def build_encoder(name: str, catalogue: Catalogue, other: Callable[[Any], bytes]) -> Callable[[Any], bytes]:
    """A function from a message to its CDR bytes; what it cannot handle it passes to `other`."""
    encoder = _Encoder(catalogue)
    encoder.scope |= {"_other": other, "_errors": _ENCODE_ERRORS}
    return encoder.build(catalogue.message(name))


class _Encoder(Source):
    def __init__(self, catalogue: Catalogue) -> None:
        super().__init__(catalogue)
        self.args: list[str] = []
        self.parts: list[str] = []  # expressions of the chunks of the message, outside loops
        self.listed = False  # whether the chunks go into a list because there is a loop
        self.loops = 0
        self.text: tuple[str, Position] | None = None  # a string whose NUL is not written yet, and where it began
        self.offset = 0  # bytes since `p` was brought up to date
        self.needs_p = False

    def build(self, definition: MessageDefinition) -> Callable[[Any], bytes]:
        self.run.append("I")
        self.args.append(_LITTLE_ENDIAN)
        self.message(definition, "m")
        self.flush()
        self.end_text()
        if self.listed:
            self.spill()
            result = "_join(_o)"
        elif len(self.parts) == 1:
            result = self.parts[0]
        else:
            result = f"_join(({', '.join(self.parts)}))"
        if not self.needs_p:
            self.lines = [line for line in self.lines if not line.lstrip().startswith("p ")]
        self.scope |= {"_as": as_view, "_join": b"".join, "_wide": encode_wide, "_bad": _bad}
        head = ["def function(m):", "  try:"]
        if self.needs_p:
            head.append("    p = 0")
        return self.compile(definition.name, head, [f"    return {result}", "  except _errors: return _other(m)"])

    def message(self, definition: MessageDefinition, value: str) -> None:
        if not definition.fields:
            self.pad(1)
        for field in definition.fields:
            self.field(field, f"{value}.{self.catalogue.shape.store(field)}")

    def field(self, field: Field, value: str) -> None:
        kind = field.type
        if kind.array and kind.base in DTYPES:
            self.numbers(field, value)
        elif kind.array:
            self.elements(field, value)
        else:
            self.single(field, value)

    def single(self, field: Field, value: str) -> None:
        kind = field.type
        if kind.is_nested:
            name = self.fresh("m")
            self.line(f"{name} = {value}")
            self.message(self.catalogue.message(kind.base), name)
        elif kind.is_string:
            self.string(value, wide=kind.base == "wstring", bound=kind.string_bound)
        else:
            self.pack(self.code(kind.base), size_of(kind.base), value)

    def string(self, value: str, *, wide: bool, bound: int) -> None:
        text = self.fresh("t")
        self.line(f"{text} = {f'_wide({value})' if wide else f'{value}.encode()'}")
        if bound:
            self.line(f"if len({text}) > {bound * 4 if wide else bound}: _bad()")
        if wide:
            self.pack("I", 4, f"len({text}) >> 2")
            self.chunk(text, f"len({text})", Position(4, 0))
            return
        size = self.fresh("n")
        self.line(f"{size} = len({text}) + 1")
        self.pack("I", 4, size)
        start = self.position
        self.chunk(text, size, Position(1, 0))
        self.text = (size, start)

    def numbers(self, field: Field, value: str) -> None:
        kind = field.type
        size = size_of(kind.base)
        dtype = self.constant(f"_{DTYPES[kind.base].name}", DTYPES[kind.base])
        self.constant("_nd", np.ndarray)
        array = self.fresh("a")
        self.line(f"{array} = {value}")
        plain = f"if type({array}) is not _nd or {array}.dtype is not {dtype}: {array} = _as({array}, {kind.base!r})"
        if kind.array == "fixed":
            self.line(plain)
            self.fixed_numbers(array, kind.capacity * size, size)
            return
        count = self.fresh("n")
        if self.catalogue.shape.arrays and kind.base != "bool":
            self.constant("_array", array_type)
            self.line(f"if type({array}) is _array and {array}.typecode == {TYPE_CODES[kind.base]!r}:")
            self.line(f"    {count} = len({array})")
            self.line("else:")
            self.line(f"    {plain}")
            self.line(f"    {count} = {array}.size")
        else:
            self.line(plain)
            self.line(f"{count} = {array}.size")
        if kind.capacity:
            self.line(f"if {count} > {kind.capacity}: _bad()")
        self.pack("I", 4, count)
        self.flush()
        if size == 8:
            self.sequence_gap(count)
        self.chunk(array, f"{size} * {count}", Position(min(size, 4), 0))

    def fixed_numbers(self, array: str, total: int, size: int) -> None:
        if total > _INLINE_ARRAY_BYTES:
            self.line(f"if {array}.nbytes != {total}: _bad()")
            self.align(size)
            after = self.position.after(total)
            self.chunk(array, str(total), after)
            return
        self.line(f"{array} = {array}.tobytes()")
        self.line(f"if len({array}) != {total}: _bad()")
        self.align(size)
        self.run.append(f"{total}s")
        self.args.append(array)
        self.advance(total)

    def sequence_gap(self, count: str) -> None:
        """Padding before 8-byte elements, which is there only if there are elements."""
        gap = self.position.gap(8)
        if gap is None:
            self.needs_p = True
            self.sync()
            pad = self.fresh("x")
            self.line(f"{pad} = _zeros[-p & 7] if {count} else b''")
            self.emit(pad)
            self.line(f"p += len({pad})")
        elif gap:
            self.emit(f"_zeros[{gap}] if {count} else b''")
            self.sync()
            self.line(f"p += {gap} if {count} else 0")
        self.scope["_zeros"] = tuple(bytes(n) for n in range(8))

    def elements(self, field: Field, value: str) -> None:
        """A sequence or array of messages or strings."""
        kind = field.type
        items = self.fresh("v")
        self.line(f"{items} = {value}")
        if kind.is_string:
            self.line(f"if type({items}) is str: _bad()")
        if kind.array == "fixed":
            self.line(f"if len({items}) != {kind.capacity}: _bad()")
        else:
            if kind.capacity:
                self.line(f"if len({items}) > {kind.capacity}: _bad()")
            self.pack("I", 4, f"len({items})")
        self.flush()
        self.end_text()
        self.sync()
        self.spill()
        element = self.fresh("e")
        self.loops += 1
        self.repeat(f"for {element} in {items}:", lambda: self.element(field, element))
        self.loops -= 1

    def element(self, field: Field, name: str) -> None:
        self.single(Field(field.name, field.type.element), name)
        self.flush()
        self.end_text()
        self.sync()

    def pack(self, code: str, size: int, value: str) -> None:
        self.align(size)
        self.run.append(code)
        self.args.append(value)
        self.advance(size)

    def pad(self, size: int) -> None:
        self.end_text()
        self.run.append(f"{size}x")
        self.advance(size)

    def advance(self, size: int) -> None:
        self.position = self.position.after(size)
        self.offset += size

    def align(self, size: int) -> None:
        self.end_text(size)
        gap = self.position.gap(size)
        if gap is None:
            self.flush()
            self.sync()
            self.needs_p = True
            pad = self.fresh("x")
            self.scope["_zeros"] = tuple(bytes(n) for n in range(8))
            self.line(f"{pad} = _zeros[-p & {size - 1}]")
            self.line(f"p += len({pad})")
            self.emit(pad)
            self.position = Position(size, 0)
        elif gap:
            self.pad(gap)

    def end_text(self, alignment: int = 1) -> None:
        """Write the NUL of the string before, with the padding that follows it if that hangs on its length alone."""
        if self.text is None:
            return
        size, start = self.text
        self.text = None
        if alignment == 1 or alignment > start.modulus:
            self.emit("b'\\0'")
            return
        residue = start.residue % alignment
        table = tuple(bytes(1 + -(residue + n) % alignment) for n in range(alignment))
        self.emit(f"{self.constant(f'_t{alignment}_{residue}', table)}[{size} & {alignment - 1}]")
        self.sync()
        self.line(f"p = p + {alignment - 1} & -{alignment}")
        self.position = Position(alignment, 0)

    def chunk(self, expression: str, size: str, after: Position) -> None:
        """Bytes of a length known only at run time."""
        self.flush()
        self.emit(expression)
        self.sync()
        self.line(f"p += {size}")
        self.position = after

    def sync(self) -> None:
        if self.offset:
            self.line(f"p += {self.offset}")
            self.offset = 0

    def flush(self) -> None:
        if self.run:
            codes = "<" + "".join(self.run)
            if self.args:
                self.emit(f"{self.struct_method(codes, 'pack')}({', '.join(self.args)})")
            else:
                self.emit(repr(bytes(sum(int(code[:-1]) for code in self.run))))
            self.run, self.args = [], []

    def emit(self, expression: str) -> None:
        if self.loops:
            self.line(f"_w({expression})")
        else:
            self.parts.append(expression)

    def spill(self) -> None:
        """Put the chunks so far into the list, in front of those that a loop appends."""
        if self.loops:
            return
        joined = "".join(f"{part}, " for part in self.parts)
        if not self.listed:
            self.line(f"_o = [{joined}]")
            self.line("_w = _o.append")
        elif joined:
            self.line(f"_o += ({joined})")
        self.listed = True
        self.parts = []


def _bad() -> None:
    raise ValueError("a length does not fit")
