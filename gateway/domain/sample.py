"""Samples: one message on a channel, and runs of consecutive ones as the link carries them."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt

from gateway.domain.channel import Channel, Series
from gateway.domain.trace import RobotTimes
from metaros.link import SampleColumns

__all__ = ["Gap", "Rows", "Run", "Sample"]


@dataclass(frozen=True, slots=True)
class Sample:
    """One message: `payload` is what the robot's node published, byte for byte."""

    channel: Channel
    seq: int
    stamp_ns: int
    receive_ns: int
    payload: bytes | memoryview


@dataclass(frozen=True, slots=True)
class Run:
    """Consecutive samples of one channel, not yet taken apart: nobody may be watching."""

    channel: Channel
    columns: SampleColumns
    receive_ns: int
    trace: RobotTimes | None = None  # of one of the samples, when it is followed

    @property
    def count(self) -> int:
        """How many samples."""
        return self.columns.count

    @property
    def size_bytes(self) -> int:
        """The samples' bytes together."""
        return len(self.columns.payload)

    def samples(self) -> Iterator[Sample]:
        """The samples, oldest first; their payloads are views into the frame."""
        for seq, stamp_ns, payload in self.columns.samples():
            yield Sample(self.channel, seq, stamp_ns, self.receive_ns, payload)

    def after(self, skip: int) -> Run:
        """The run without its first `skip` samples."""
        return replace(self, columns=self.columns.after(skip)) if skip else self


@dataclass(frozen=True, slots=True)
class Rows:
    """Metric rows of one robot as columns: `index` points into `series`."""

    series: tuple[Series, ...]
    index: npt.NDArray[np.unsignedinteger]
    stamps: npt.NDArray[np.int64]
    values: npt.NDArray[np.float64]

    def __len__(self) -> int:
        return len(self.values)

    def after(self, skip: int) -> Rows:
        """The rows without the first `skip` of them."""
        return self if not skip else Rows(self.series, self.index[skip:], self.stamps[skip:], self.values[skip:])


@dataclass(frozen=True, slots=True)
class Gap:
    """A loss the robot declared: seq `from_seq` to `to_seq`, both included, will never come."""

    from_seq: int
    to_seq: int
    reason: str
    from_ns: int
    to_ns: int

    @property
    def count(self) -> int:
        """How many samples are lost."""
        return self.to_seq - self.from_seq + 1
