"""What an outbox directory is: the epochs of its eras, and which processes wrote to it since the gateway last said so.

An epoch is the random name under which a directory's numbers are known to the gateway. An era is the outbox's own
small number for it, kept in the segments, so that all of an era's frames can be given another epoch at once: that is
what a directory does that was copied, when its twin has already spoken under the old one.

Each process notes what it found when it began. So a copy knows that whatever the gateway has beyond that, written by
the process before, was written after the copy was made: by the original.
"""

from __future__ import annotations

import json
import zlib
from collections.abc import Callable, Collection, Mapping
from dataclasses import asdict, dataclass, field, replace

from edge_agent.outbox.disk import Disk

__all__ = ["OutboxState"]

_NAME = "state.json"
_MAX_BYTES = 16 * 1024 * 1024
_WRITERS = 256
_OLD_WRITERS = 16  # kept before the one that the gateway knows, should its store be put back to an older backup

Streams = dict[int, int]  # stream -> a number


@dataclass(slots=True)
class OutboxState:
    """Saved as a whole, synced, before anything is written under what it says."""

    epochs: dict[int, int] = field(default_factory=dict)  # era -> epoch
    writers: list[str] = field(default_factory=list)  # the last one the gateway knows, then all since
    bases: dict[int, Streams] = field(default_factory=dict)  # era -> stream -> newest number of an older epoch
    # writer -> era -> stream -> newest number that it found, where that is not what the writer before it found
    found: dict[str, dict[int, Streams]] = field(default_factory=dict)
    sender: str = ""  # the last writer that had a session: those since have sent nothing

    @property
    def era(self) -> int:
        """The present one."""
        return max(self.epochs)

    @classmethod
    def load(cls, disk: Disk) -> OutboxState | None:
        """What the directory says; None when it is new, or when what it says cannot be read."""
        try:
            crc, _, body = (disk.read(_NAME, 0, _MAX_BYTES) if disk.size(_NAME) else b"").partition(b" ")
            if not body or int(crc, 16) != zlib.crc32(body):
                return None
            facts = json.loads(body)
            epochs = {int(era): int(epoch) for era, epoch in facts["epochs"].items()}
            found = {writer: numbers(eras) for writer, eras in facts["found"].items()}
            state = cls(epochs, list(facts["writers"]), numbers(facts["bases"]), found, str(facts["sender"]))
            return state if epochs else None
        except (ValueError, KeyError, TypeError, AttributeError, OverflowError, RecursionError):
            return None

    def save(self, disk: Disk) -> None:
        """Raises DiskError; the old state then stays."""
        body = json.dumps(asdict(self), separators=(",", ":")).encode()
        disk.replace(_NAME, b"%08x %s" % (zlib.crc32(body), body))

    def begin_era(self, new_epoch: Callable[[], int]) -> None:
        """Another era after the present one."""
        self.epochs[max(self.epochs, default=0) + 1] = fresh(new_epoch)

    def relabelled(self, new_epoch: Callable[[], int], bases: dict[int, dict[int, int]]) -> OutboxState:
        """With another epoch for every era, in which each stream begins after its number in `bases`."""
        return replace(self, epochs={era: fresh(new_epoch) for era in self.epochs}, bases=bases)

    def with_writer(self, writer: str, last: Mapping[int, Mapping[int, int]]) -> OutboxState:
        """A process begins to write, and finds these numbers; the writer that the gateway knows is kept."""
        known = self._found_until(len(self.writers))
        news = {
            era: {stream: seq for stream, seq in streams.items() if known.get(era, {}).get(stream) != seq}
            for era, streams in last.items()
        }
        more = replace(self, writers=[*self.writers, writer], found={**self.found, writer: news})
        after = self.writers.index(self.sender) + 1 if self.sender in self.writers else 0
        oldest = self.writers[: 2 * _OLD_WRITERS]  # among them the one the gateway knows, and the next one
        newest = self.writers[-(_WRITERS - 2 * _OLD_WRITERS - 3) :]
        kept = {*oldest, self.sender, *self.writers[after : after + 1], *newest, writer}
        return more._only([known for known in more.writers if known in kept])

    def known(self, stored: Collection[str], held: Collection[int]) -> OutboxState:
        """The gateway has these writers in store: those long before them, and eras of which nothing is held, go."""
        places = [self.writers.index(writer) for writer in stored if writer in self.writers]
        kept = self._only(self.writers[max(0, min(places, default=0) - _OLD_WRITERS) :])
        kept.epochs = {era: epoch for era, epoch in self.epochs.items() if era in held or era == self.era}
        kept.bases = {era: streams for era, streams in self.bases.items() if era in kept.epochs}
        kept.found = {
            writer: {era: streams for era, streams in eras.items() if era in kept.epochs}
            for writer, eras in kept.found.items()
        }
        return kept

    def overtaken(
        self, last: Mapping[int, Streams], marks: Mapping[tuple[int, int], int], writers: Mapping[int, str]
    ) -> int:
        """A stream of which the gateway has more than this directory can have sent; -1 where there is none.

        That is what our last process with a session gave, and no more than what the process gave that the gateway
        knows as its era's writer. `last` has the newest numbers that there are.
        """
        found = {writer: self.found_after(writer) for writer in writers.values()}
        unsent = self.found_after(self.sender)
        for (era, stream), mark in marks.items():
            if era != self.era and stream not in last.get(era, {}):
                continue  # all of it was acknowledged and let go
            known = [last, unsent, found[writers[era]] if era in writers else None]
            given = min(newest.get(era, {}).get(stream, 0) for newest in known if newest is not None)
            if mark > max(given, self.bases.get(era, {}).get(stream, 0)):
                return stream
        return -1

    def found_after(self, writer: str) -> dict[int, Streams] | None:
        """What the process after this writer found (the first one, after ""); None where there was none after it."""
        place = self.writers.index(writer) + 1 if writer in self.writers else 0 if not writer else len(self.writers)
        return self._found_until(place + 1) if place < len(self.writers) else None

    def _found_until(self, count: int) -> dict[int, Streams]:
        """What the last of the first `count` writers found."""
        found: dict[int, Streams] = {}
        for writer in self.writers[:count]:
            for era, streams in self.found.get(writer, {}).items():
                found.setdefault(era, {}).update(streams)
        return found

    def _only(self, writers: list[str]) -> OutboxState:
        """With these of its writers; what others found is reported by the next one that stays."""
        found: dict[str, dict[int, Streams]] = {}
        waiting: dict[int, Streams] = {}
        for writer in self.writers:
            for era, streams in self.found.get(writer, {}).items():
                waiting.setdefault(era, {}).update(streams)
            if writer in writers:
                found[writer], waiting = waiting, {}
        return replace(self, writers=writers, found=found)


def numbers(eras: Mapping[str, Mapping[str, int]]) -> dict[int, Streams]:
    """Era -> stream -> number, as JSON has them."""
    return {int(era): {int(stream): int(seq) for stream, seq in streams.items()} for era, streams in eras.items()}


def fresh(new_epoch: Callable[[], int]) -> int:
    """A random epoch, never 0."""
    return new_epoch() or 1
