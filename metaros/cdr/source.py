"""What the generators of encoders and decoders share: lines of Python, constants, and the current position."""

from __future__ import annotations

import struct
from collections.abc import Callable
from typing import Any

from metaros.cdr.layout import CODES, Order, Position
from metaros.idl import Catalogue

__all__ = ["Source"]


class Source:
    """A function under construction.

    `run` collects struct codes of fields that lie at known distances, so that one `Struct` handles them all;
    `flush` (of the subclass) turns it into code. `position` is what is known of the alignment.
    """

    def __init__(self, catalogue: Catalogue, *, order: Order = "<") -> None:
        self.catalogue = catalogue
        self.order = order
        self.lines: list[str] = []
        self.scope: dict[str, Any] = {}
        self.position = Position()
        self.run: list[str] = []
        self.indent = 1
        self._counter = 0
        self._structs: dict[str, str] = {}

    def line(self, text: str) -> None:
        """Add a line at the current indentation."""
        self.lines.append("    " * self.indent + text)

    def fresh(self, prefix: str) -> str:
        """A new variable name."""
        self._counter += 1
        return f"{prefix}{self._counter}"

    def constant(self, name: str, value: Any) -> str:
        """Make `value` known to the function as `name`."""
        self.scope[name] = value
        return name

    def code(self, base: str) -> str:
        """The struct code of one primitive, as the classes of this catalogue hold it."""
        return self.catalogue.shape.octet if base == "byte" else CODES[base]

    def struct_method(self, codes: str, method: str) -> str:
        """The name of `Struct(codes).method`, one constant for each format."""
        key = f"{method}:{codes}"
        if key not in self._structs:
            self._structs[key] = self.constant(f"_s{len(self._structs)}", getattr(struct.Struct(codes), method))
        return self._structs[key]

    def repeat(self, header: str, body: Callable[[], None]) -> None:
        """A loop whose body starts from what is known after none or any number of rounds."""
        entry = self.position
        while True:
            mark = len(self.lines)
            self.position = entry
            self.line(header)
            self.indent += 1
            body()
            self.indent -= 1
            joined = entry.meet(self.position)
            if joined == entry:
                break
            entry = joined
            del self.lines[mark:]
        self.position = entry

    def compile(self, name: str, head: list[str], tail: list[str]) -> Callable[..., Any]:
        """The finished function."""
        text = "\n".join([*head, *self.lines, *tail])
        exec(compile(text, f"<cdr {name}>", "exec"), self.scope)
        function: Callable[..., Any] = self.scope["function"]
        return function
