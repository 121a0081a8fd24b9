"""Compiled field readers: a few numbers straight from CDR, without decoding the rest of the message."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from typing import Any

from metaros.cdr.codec import Readable, split_header
from metaros.cdr.cursor import Cursor
from metaros.cdr.decoder import DECODE_ERRORS
from metaros.cdr.layout import CODES, HEADER_BYTES, Order, Position, check_size, size_of
from metaros.cdr.paths import Node, path_tree
from metaros.cdr.reference import ReferenceDecoder
from metaros.errors import DecodeError
from metaros.idl import Catalogue, FieldType, MessageDefinition, default_catalogue
from metaros.idl.arrays import DTYPES
from metaros.limits import LIMITS

__all__ = ["field_reader"]

Reader = Callable[[Readable], tuple[float, ...]]


def field_reader(
    name: str | type[Any], paths: Sequence[str], catalogue: Catalogue | None = None
) -> Callable[[Readable], tuple[float, ...]]:
    """A function from CDR bytes of the message `name` to the numbers at `paths`, as floats.

    A path is like "percentage", "pose.pose.position.x", "position[2]" or "transforms[0].transform.rotation.z".
    An index past the end of a sequence reads as NaN. What lies behind the last path is not looked at. Unknown and
    non-numeric paths are a `FieldError` here, bytes that end too early a `DecodeError` when read.
    """
    if isinstance(name, str):
        full_name = name
    else:
        full_name = name.__metaros_name__
        catalogue = catalogue or name.__metaros_catalogue__
    home = (catalogue or default_catalogue()).home(full_name)
    wanted = tuple(paths)
    made: dict[tuple[str, ...], Reader] = home.memo("readers", full_name, dict)
    reader = made.get(wanted)
    if reader is None:
        reader = made[wanted] = _build(full_name, wanted, home)
        if len(made) > LIMITS.type_cache:
            made.pop(next(iter(made)))
    return reader


def _build(name: str, paths: tuple[str, ...], catalogue: Catalogue) -> Reader:
    check_size(name, catalogue)
    tree, bases = path_tree(name, list(paths), catalogue)
    definition = catalogue.message(name)
    general: dict[str, Callable[[Any], tuple[float, ...]]] = {}

    def other(data: Readable) -> tuple[float, ...]:
        order, body = split_header(data)
        if order not in general:
            general[order] = _Reader(catalogue, order=order, base=0).build(definition, tree, bases, None)
        try:
            return general[order](body)
        except DECODE_ERRORS:
            try:
                ReferenceDecoder(catalogue, body, order=order).message(definition, "")
            except DecodeError as error:
                raise DecodeError(f"{name}: {error}") from None
            raise DecodeError(f"{name}: malformed CDR") from None

    return _Reader(catalogue, order="<", base=HEADER_BYTES).build(definition, tree, bases, other)


class _Reader(Cursor):
    def __init__(self, catalogue: Catalogue, *, order: Order, base: int) -> None:
        super().__init__(catalogue, base=base, order=order)
        self.pending = 0  # values that are wanted from here on

    def build(
        self,
        definition: MessageDefinition,
        tree: Node,
        bases: list[str],
        other: Callable[[Any], tuple[float, ...]] | None,
    ) -> Callable[[Any], tuple[float, ...]]:
        self.pending = tree.count()
        self.message(definition, tree)
        self.flush()
        values = [f"o{i}" if base in ("float32", "float64") else f"float(o{i})" for i, base in enumerate(bases)]
        head = ["def function(b):", "  if True:"] if other is None else _FAST_HEAD
        tail = [f"    return ({''.join(f'{value}, ' for value in values)})"]
        if other is not None:
            tail.append("  except _errors: return _other(b)")
        names = [f"o{index} = " for index in range(len(bases))]
        if names:
            head = [*head, f"    {''.join(names)}_nan"]
        self.scope |= {"_nan": math.nan, "_other": other, "_errors": DECODE_ERRORS, "_bad": ValueError}
        return self.compile(definition.name, head, tail)

    def message(self, definition: MessageDefinition, node: Node | None) -> None:
        if not definition.fields:
            self.skip(1)
        for field in definition.fields:
            if not self.pending:
                return
            self.value(field.type, node.members.get(field.name) if node else None)

    def value(self, kind: FieldType, node: Node | None) -> None:
        if kind.array and kind.base in DTYPES:
            self.numbers(kind, node)
        elif kind.array:
            self.elements(kind, node)
        elif kind.is_nested:
            self.message(self.catalogue.message(kind.base), node)
        elif kind.is_string:
            self.string(wide=kind.base == "wstring")
        else:
            self.align(size_of(kind.base))
            self.read(kind.base, node)

    def read(self, base: str, node: Node | None) -> None:
        if node is None:
            self.skip(size_of(base))
            return
        self.add(CODES[base], size_of(base), f"o{node.outputs[0]}")
        self.pending -= len(node.outputs)
        if len(node.outputs) > 1:
            self.flush()
            self.line(f"{' = '.join(f'o{index}' for index in node.outputs[1:])} = o{node.outputs[0]}")

    def string(self, *, wide: bool) -> None:
        count = self.count()
        self.move(f"{self.here()} + {f'4 * {count}' if wide else count}", Position(4 if wide else 1, 0))

    def count(self) -> str:
        name = self.fresh("n")
        self.align(4)
        self.add("I", 4, name)
        self.flush()
        return name

    def numbers(self, kind: FieldType, node: Node | None) -> None:
        size = size_of(kind.base)
        wanted = sorted(node.elements.items()) if node else []
        if kind.array == "fixed":
            self.align(size)
            reached = 0
            for index, element in wanted:
                self.skip((index - reached) * size)
                self.read(kind.base, element)
                reached = index + 1
            self.skip((kind.capacity - reached) * size)
            return
        count = self.count()
        self.move(self.here(), self.position)
        self.line(f"if {count}:")
        self.indent += 1
        if self.position.gap(size) != 0:
            self.line(f"p = {self.rounded(size)}")
        for index, element in wanted:
            names = " = ".join(f"o{output}" for output in element.outputs)
            method = self.struct_method(self.order + CODES[kind.base], "unpack_from")
            self.line(f"if {count} > {index}: {names} = {method}(b, p + {index * size})[0]")
            self.pending -= len(element.outputs)
        self.line(f"p += {count} * {size}")
        self.indent -= 1
        self.position = Position(min(size, 4), 0)

    def elements(self, kind: FieldType, node: Node | None) -> None:
        wanted = sorted(node.elements.items()) if node else []
        count = str(kind.capacity) if kind.array == "fixed" else self.count()
        self.flush()
        self.line(f"if {count} > len(b): raise _bad()")
        self.move(self.here(), self.position)
        stride = None if wanted else _stride(kind.element, self.catalogue)
        if stride:
            self.skip_all(count, *stride)
            return
        inside = sum(element.count() for _, element in wanted)
        after = self.pending - inside
        limit = count if after or not wanted else f"min({count}, {wanted[-1][0] + 1})"
        index = self.fresh("i")

        def body() -> None:
            self.pending = inside + after
            self.branches(kind.element, wanted, index)

        self.repeat(f"for {index} in range({limit}):", body)
        self.pending = after

    def branches(self, kind: FieldType, wanted: list[tuple[int, Node]], index: str) -> None:
        entry, pending = self.position, self.pending
        exits: list[Position] = []
        for position, element in [*wanted, (-1, None)]:
            self.line(
                f"{'elif' if exits else 'if'} {index} == {position}:" if element else ("else:" if exits else "if True:")
            )
            self.indent += 1
            self.position, self.offset, self.start = entry, 0, 0
            self.pending = pending if element is None else element.count() + 1
            self.value(kind, element)
            self.flush()
            self.move(self.here(), self.position)
            self.line("pass")
            self.indent -= 1
            exits.append(self.position)
        for known in exits:
            self.position = self.position.meet(known)

    def skip_all(self, count: str, stride: int, alignment: int) -> None:
        self.line(f"if {count}:")
        self.indent += 1
        if self.position.gap(alignment) != 0:
            self.line(f"p = {self.rounded(alignment)}")
        self.line(f"p += {count} * {stride}")
        self.indent -= 1
        self.position = Position(min(alignment, 4), 0)

    def flush(self) -> None:
        while self.run and self.run[-1].endswith("x"):
            self.run.pop()
        super().flush()


_FAST_HEAD = ["def function(b):", "  try:", "    if b[1] != 1 or b[0]: return _other(b)"]


def _stride(kind: FieldType, catalogue: Catalogue) -> tuple[int, int] | None:
    """Distance and alignment of elements that all have one size, whose first field is the most aligned one."""
    sizes: list[int] = []
    position = 0
    for size, count in _primitives(kind, catalogue):
        if not size:
            return None
        position += -position % size + size * count
        sizes.append(size)
    widest = max(sizes)
    return (position, widest) if sizes[0] == widest and position % widest == 0 else None


def _primitives(kind: FieldType, catalogue: Catalogue) -> list[tuple[int, int]]:
    """(size, count) of each primitive in order; (0, 0) for anything of variable length."""
    if kind.is_string or kind.is_sequence:
        return [(0, 0)]
    if not kind.is_nested:
        return [(size_of(kind.base), kind.capacity or 1)]
    if kind.array:
        return [(0, 0)]
    fields = catalogue.message(kind.base).fields
    return [item for field in fields for item in _primitives(field.type, catalogue)] or [(1, 1)]
