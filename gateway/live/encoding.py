"""What viewers get is made once: blocks of samples, and encodings that turn a block into bytes for all who share them.

An `Encoding` is a value: viewers whose encodings are equal get the very same bytes object. A protocol therefore puts
into its encoding only what changes the bytes, such as a subscription's number.
"""

from __future__ import annotations

from collections.abc import Callable, Hashable, Sequence
from typing import Any, ClassVar, Protocol, TypeVar

from gateway.domain.channel import Channel
from gateway.domain.records import Record, records_bytes

__all__ = ["Block", "Encoding", "View", "view_of"]

T = TypeVar("T")
View = Callable[[Channel, Record], T]  # a sample decoded; a module-level function, since blocks remember by it


class Encoding(Hashable, Protocol):
    """How a block becomes what a viewer's connection carries. Frozen dataclasses make good ones.

    `view` names the function whose results `encode` asks the block for; it is called before `encode`, once per sample
    for all viewers, and in a thread where it takes long. None: `encode` needs the samples' bytes only.
    """

    view: ClassVar[View[Any] | None]

    def encode(self, block: Block, /) -> bytes:
        """The block as bytes, ready to be written; called once per block for all viewers with an equal encoding."""


def view_of(encoding: Encoding) -> View[Any] | None:
    """The view that an encoding needs, as a plain function."""
    view: Any = type(encoding).view
    made: View[Any] | None = view.__get__(encoding) if isinstance(view, property) else view  # of that very encoding
    return made


class Block:
    """Consecutive samples of one channel that go out together, with what was made of them."""

    __slots__ = ("_encoded", "channel", "records", "size_bytes")

    def __init__(self, channel: Channel, records: Sequence[Record]) -> None:
        self.channel = channel
        self.records = records
        self.size_bytes = records_bytes(records)
        self._encoded: dict[Hashable, bytes] = {}

    def encoded(self, encoding: Encoding) -> bytes:
        """The block in that encoding, made when it is asked for first."""
        data = self._encoded.get(encoding)
        if data is None:
            data = self._encoded[encoding] = encoding.encode(self)
        return data

    def has(self, view: View[Any]) -> bool:
        """Whether that view of its samples is made already."""
        return all(view in record.views for record in self.records)

    def views(self, view: View[T]) -> list[T | None]:
        """That view of each sample; None for a sample of which it cannot be made. Made once, for all blocks."""
        channel = self.channel
        return [
            record.views[view] if view in record.views else _viewed(view, channel, record) for record in self.records
        ]

    def rest(self, start: int) -> Block:
        """The block without its first `start` samples."""
        return self.only(self.records[start:]) if start else self

    def only(self, records: Sequence[Record]) -> Block:
        """A block of some of its samples."""
        return Block(self.channel, records)


def _viewed(view: View[T], channel: Channel, record: Record) -> T | None:
    made: T | None
    try:
        made = view(channel, record)
    except Exception:  # a robot may send what it likes: one bad sample is left out and ends nothing
        made = None
    record.views[view] = made
    return made
