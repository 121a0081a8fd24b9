"""Sequence bookkeeping: per stream and epoch, what was accepted and what is stored. Pure; outlives sessions."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass

from gateway.domain.sample import Gap
from gateway.errors import ProtocolError
from metaros._proto import link_pb2

__all__ = ["Accepted", "StreamTable"]

Key = tuple[int, int]
MAX_SEQ = 2**63 - 1
MAX_EPOCHS = 16_384  # of one robot, ever: each is an outbox, or one life of it


@dataclass(frozen=True, slots=True)
class Accepted:
    """How much of a run is new: skip the first `duplicates`; the stream now stands at `seq`."""

    duplicates: int
    seq: int


class StreamTable:
    """One robot's watermarks, and who last wrote under each epoch.

    `accepted` moves when a frame arrives, `stored` when its commit is done.
    """

    def __init__(
        self,
        stored: Mapping[Key, int] | None = None,
        *,
        writers: Mapping[int, str] | None = None,
        max_streams: int = 65536,
    ) -> None:
        self.writers: dict[int, str] = dict(writers or {})
        self._stored_writers: dict[int, str] = dict(writers or {})
        self._stored: dict[Key, int] = dict(stored or {})
        self._accepted: dict[Key, int] = dict(self._stored)
        self._bases: dict[Key, int] = {}
        self._confirmed: dict[Key, int] = {}  # what our own commits said, in their order
        self._max_streams = max_streams
        self._submitted: dict[int, int] = {}  # epoch -> writes on their way to the store

    @property
    def epochs(self) -> int:
        """Under how many epochs the robot has ever stored something."""
        return len({epoch for _, epoch in self._stored})

    def accepted(self, stream_id: int, epoch: int) -> int:
        """The last sequence number taken in, 0 for none."""
        return self._accepted.get((stream_id, epoch), 0)

    def stored(self, stream_id: int, epoch: int) -> int:
        """The last sequence number committed, 0 for none."""
        return self._stored.get((stream_id, epoch), 0)

    def base(self, stream_id: int, epoch: int) -> int:
        """After which number the stream begins, in case nothing of it is stored yet."""
        return self._bases.get((stream_id, epoch), 0)

    def known(self) -> dict[Key, int]:
        """What is stored, as far as we know now."""
        return {key: seq for key, seq in self._stored.items() if seq > self._bases.get(key, 0)}

    def refresh(self, stored: Mapping[Key, int], writers: Mapping[int, str]) -> None:
        """Another gateway on the same store may have served the robot meanwhile."""
        for (stream_id, epoch), seq in stored.items():
            self.commit(stream_id, epoch, seq)
        for epoch, writer in writers.items():
            if self._stored_writers.get(epoch) != writer:
                self._stored_writers[epoch] = self.writers[epoch] = writer

    def confirm(self, stream_id: int, epoch: int, seq: int) -> bool:
        """A commit of ours found or left this watermark; False when an earlier one had left a higher."""
        key = (stream_id, epoch)
        if seq < self._confirmed.get(key, 0):
            return False
        self._put(self._confirmed, key, seq)
        self.commit(stream_id, epoch, seq)
        return True

    def accept(self, stream_id: int, epoch: int, first_seq: int, last_seq: int) -> Accepted:
        """Take a run of a durable stream in; ProtocolError when samples before it are missing and undeclared."""
        watermark = self.accepted(stream_id, epoch)
        if first_seq > watermark + 1:
            raise ProtocolError(
                f"stream {stream_id}: seq {first_seq} follows {watermark}, and no gap declares what is between"
            )
        duplicates = max(0, min(last_seq, watermark) - first_seq + 1)
        if last_seq > watermark:
            self._put(self._accepted, (stream_id, epoch), last_seq)
        return Accepted(duplicates, max(last_seq, watermark))

    def skip(self, stream_id: int, epoch: int, gap: Gap) -> Gap | None:
        """Move over a declared gap; returns the part of it that is new, None when nothing is."""
        if not 1 <= gap.from_seq <= gap.to_seq <= MAX_SEQ:
            raise ProtocolError(f"stream {stream_id}: no gap goes from {gap.from_seq} to {gap.to_seq}")
        watermark = self.accepted(stream_id, epoch)
        if gap.to_seq <= watermark:
            return None
        if gap.from_seq > watermark + 1:
            raise ProtocolError(f"stream {stream_id}: a gap from {gap.from_seq} does not follow seq {watermark}")
        self._put(self._accepted, (stream_id, epoch), gap.to_seq)
        return Gap(watermark + 1, gap.to_seq, gap.reason, gap.from_ns, gap.to_ns)

    def commit(self, stream_id: int, epoch: int, seq: int) -> None:
        """A commit with this watermark is done."""
        key = (stream_id, epoch)
        if seq > self._stored.get(key, 0):
            self._put(self._stored, key, seq)
        if seq > self._accepted.get(key, 0):  # it was on its way when the rest was refused
            self._put(self._accepted, key, seq)

    def forked(self, hello: link_pb2.Hello) -> bool:
        """Whether another copy of the agent's outbox has spoken under one of its epochs."""
        known = {self.writers.get(epoch) for epoch in epochs_of(hello)} - {None}
        return bool(hello.writers) and not known <= set(hello.writers)

    def commit_writer(self, epoch: int, writer: str) -> None:
        """A commit with this writer is done."""
        self._stored_writers[epoch] = writer

    def stored_writers(self, hello: link_pb2.Hello) -> dict[int, str]:
        """The writers of the agent's epochs that are stored."""
        epochs = epochs_of(hello)
        return {epoch: writer for epoch, writer in self._stored_writers.items() if epoch in epochs}

    def unsettled(self, hello: link_pb2.Hello) -> bool:
        """Whether an earlier writer's samples of the agent's epochs are still on their way to the store.

        They may be another copy's, so the new one must be told of them; once they are stored, or refused, it is.
        """
        writer = hello.writers[-1] if hello.writers else ""
        return any(
            self._submitted.get(epoch, 0) and self.writers.get(epoch, writer) != writer for epoch in epochs_of(hello)
        )

    def submitted(self, epoch: int) -> None:
        """A write of this epoch waits for a commit."""
        self._submitted[epoch] = self._submitted.get(epoch, 0) + 1

    def settled(self, epoch: int) -> None:
        """One of them was committed."""
        if self._submitted.get(epoch, 0) > 1:
            self._submitted[epoch] -= 1
        else:
            self._submitted.pop(epoch, None)

    def gave_up(self) -> None:
        """The store gave up all of them; what was accepted is forgotten, and its agent sends it again."""
        self._submitted.clear()
        self.refuse()

    def written_by(self, hello: link_pb2.Hello) -> dict[int, str]:
        """Note the agent's process as the writer of its epochs; those of which that is new."""
        if not hello.writers:
            return {}
        writer = hello.writers[-1]
        news = {epoch: writer for epoch in epochs_of(hello) if self.writers.get(epoch) != writer}
        if len(self.writers.keys() | news.keys()) > MAX_EPOCHS:
            raise ProtocolError(f"robots have at most {MAX_EPOCHS} epochs")
        self.writers.update(news)
        return news

    def marks(self, hello: link_pb2.Hello) -> dict[Key, int]:
        """The watermarks of the streams that a Hello names, and of all others of its epochs."""
        named = {(state.stream_id, state.epoch): 0 for state in hello.streams}
        epochs = epochs_of(hello)
        return named | {key: seq for key, seq in self._stored.items() if key[1] in epochs}

    def refuse(self) -> None:
        """What was accepted and is not stored is forgotten: its agent sends it again."""
        self._accepted = dict(self._stored)

    def begin(self, states: Iterable[link_pb2.StreamState]) -> None:
        """Streams that were never seen begin after their base: what is before it has another epoch."""
        for state in states:
            key = (state.stream_id, state.epoch)
            if state.base_seq and key not in self._accepted:
                self._put(self._bases, key, state.base_seq)
                self._put(self._accepted, key, state.base_seq)
                self._put(self._stored, key, state.base_seq)

    def missing(self, states: Iterable[link_pb2.StreamState], *, wall_ns: int) -> list[tuple[int, int, Gap]]:
        """Gaps nobody can fill: the agent's oldest sample is newer than what we have, so it is lost."""
        gaps = []
        for state in states:
            watermark = self.accepted(state.stream_id, state.epoch)
            if watermark + 1 < state.first_seq <= MAX_SEQ:
                gap = Gap(watermark + 1, state.first_seq - 1, "not_held", wall_ns, wall_ns)
                gaps.append((state.stream_id, state.epoch, gap))
        return gaps

    def _put(self, table: dict[Key, int], key: Key, seq: int) -> None:
        if key not in table and len(table) >= self._max_streams:
            del table[next(iter(table))]
        table[key] = seq


def epochs_of(hello: link_pb2.Hello) -> set[int]:
    """The epochs of the agent's outbox."""
    return {*hello.epochs, *(state.epoch for state in hello.streams)}
