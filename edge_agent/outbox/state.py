"""What an outbox directory is: the epochs of its eras, and which processes wrote to it since the gateway last said so.

An epoch is the random name under which a directory's numbers are known to the gateway. An era is the outbox's own
small number for it, kept in the segments, so that all of an era's frames can be given another epoch at once: that is
what a directory does that was copied, when its twin has already spoken under the old one.
"""

from __future__ import annotations

import json
from collections.abc import Callable, Collection
from dataclasses import dataclass, field, replace

from edge_agent.outbox.disk import Disk

__all__ = ["OutboxState"]

_NAME = "state.json"
_MAX_BYTES = 1024 * 1024
_WRITERS = 256


@dataclass(slots=True)
class OutboxState:
    """Saved as a whole, synced, before anything is written under what it says."""

    epochs: dict[int, int] = field(default_factory=dict)  # era -> epoch
    writers: list[str] = field(default_factory=list)  # the last one the gateway knows, then all since
    bases: dict[int, dict[int, int]] = field(default_factory=dict)  # era -> stream -> newest number of an older epoch

    @property
    def era(self) -> int:
        """The present one."""
        return max(self.epochs)

    @classmethod
    def load(cls, disk: Disk) -> OutboxState | None:
        """What the directory says; None when it is new, or when what it says cannot be read."""
        try:
            facts = json.loads(disk.read(_NAME, 0, _MAX_BYTES)) if disk.size(_NAME) else None
            if facts is None:
                return None
            epochs = {int(era): int(epoch) for era, epoch in facts["epochs"].items()}
            bases = {
                int(era): {int(stream): int(seq) for stream, seq in streams.items()}
                for era, streams in facts["bases"].items()
            }
            return cls(epochs, list(facts["writers"]), bases) if epochs else None
        except (ValueError, KeyError, TypeError, AttributeError):
            return None

    def save(self, disk: Disk) -> None:
        """Raises DiskError; the old state then stays."""
        facts = {"epochs": self.epochs, "writers": self.writers, "bases": self.bases}
        disk.replace(_NAME, json.dumps(facts).encode())

    def begin_era(self, new_epoch: Callable[[], int]) -> None:
        """Another era after the present one."""
        self.epochs[max(self.epochs, default=0) + 1] = fresh(new_epoch)

    def relabelled(self, new_epoch: Callable[[], int], bases: dict[int, dict[int, int]]) -> OutboxState:
        """With another epoch for every era, in which each stream begins after its number in `bases`."""
        return replace(self, epochs={era: fresh(new_epoch) for era in self.epochs}, bases=bases)

    def with_writer(self, writer: str) -> OutboxState:
        """A process begins to write; the one that the gateway knows is kept."""
        return replace(self, writers=[*self.writers[:1], *self.writers[1:][-(_WRITERS - 2) :], writer])

    def known(self, stored: Collection[str], held: Collection[int]) -> OutboxState:
        """The gateway has these writers in store: those before them, and eras of which nothing is held, go."""
        places = [self.writers.index(writer) for writer in stored if writer in self.writers]
        epochs = {era: epoch for era, epoch in self.epochs.items() if era in held or era == self.era}
        bases = {era: streams for era, streams in self.bases.items() if era in epochs}
        return OutboxState(epochs, self.writers[min(places, default=0) :], bases)


def fresh(new_epoch: Callable[[], int]) -> int:
    """A random epoch, never 0."""
    return new_epoch() or 1
