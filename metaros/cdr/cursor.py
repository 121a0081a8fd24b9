"""A position in bytes that are read: static as long as it can be, in the variable `p` after that."""

from __future__ import annotations

from metaros.cdr.layout import Order, Position
from metaros.cdr.source import Source
from metaros.idl import Catalogue

__all__ = ["Cursor"]


class Cursor(Source):
    """The part that decoders and field readers share.

    `base` is where the body starts in the variable `b`: 4 if `b` includes the header. `offset` is the distance from
    `p`, or from the start of `b` while nothing of variable length was met; `start` is the offset of the run.
    """

    def __init__(self, catalogue: Catalogue, *, base: int, order: Order) -> None:
        super().__init__(catalogue, order=order)
        self.base = base
        self.offset = base
        self.start = base
        self.moved = False  # whether `p` exists
        self.targets: list[str] = []

    def flush(self) -> None:
        """Unpack the run into its targets."""
        if self.run:
            method = self.struct_method(self.order + "".join(self.run), "unpack_from")
            call = f"{method}(b, {self.address(self.start)})"
            self.line(f"{''.join(f'{target}, ' for target in self.targets)}= {call}" if self.targets else call)
        self.run, self.targets = [], []
        self.start = self.offset

    def add(self, code: str, size: int, target: str) -> None:
        """Append a field to the run."""
        self.run.append(code)
        self.targets.append(target)
        self.advance(size)

    def advance(self, size: int) -> None:
        """Go on by a known distance."""
        self.offset += size
        self.position = self.position.after(size)

    def skip(self, size: int) -> None:
        """Leave out bytes: as padding of the run if there is one."""
        self.advance(size)
        if not self.run:
            self.start = self.offset
        elif size:
            self.run.append(f"{size}x")

    def align(self, size: int) -> None:
        """Go on to a multiple of `size` in the body."""
        gap = self.position.gap(size)
        if gap is None:
            self.flush()
            self.move(self.rounded(size), Position(size, 0))
        elif gap:
            self.skip(gap)

    def rounded(self, size: int) -> str:
        """The expression of the next position that is a multiple of `size` in the body."""
        shift = self.base % size
        text = f"{self.here(size - 1 - shift)} & -{size}"
        return f"({text}) + {shift}" if shift else text

    def here(self, extra: int = 0) -> str:
        """The expression of the present position, or of one `extra` bytes further."""
        return self.address(self.offset + extra)

    def address(self, distance: int) -> str:
        """The expression of the position `distance` bytes behind what is known."""
        if not self.moved:
            return str(distance)
        return f"p + {distance}" if distance else "p"

    def move(self, expression: str, known: Position) -> None:
        """Put the position into `p`; `known` is what is known of it."""
        if expression != "p":
            self.line(f"p = {expression}")
        self.moved = True
        self.offset = self.start = 0
        self.position = known
