"""Is the simulated world strict enough? Each rule of the contract, broken, makes some of its seeds fail."""

from __future__ import annotations

import pytest

from edge_agent.outbox.outbox import FlushJob
from edge_agent.outbox.pending import Lost, Sample
from edge_agent.outbox.rewrite import RewriteJob
from gateway.ingest.events import Arrived, Event, GapDeclared, RowsArrived
from gateway.ingest.session import Session
from gateway.ingest.streams import Accepted, StreamTable
from metaros._proto import link_pb2
from tests.support.simulation.link_sim import Parts, run_simulation
from tests.support.simulation.sim_agent import Agent, WatchedOutbox
from tests.support.simulation.sim_disk import SimDisk
from tests.support.simulation.sim_gateway import Gateway, SimStore, described

SEEDS = 150


class HastyTable(StreamTable):
    """Says in a Welcome what was accepted, stored or not."""

    def marks(self, hello: link_pb2.Hello) -> dict[tuple[int, int], int]:
        return {key: max(seq, self.accepted(*key)) for key, seq in super().marks(hello).items()}


class HastyGateway(Gateway):
    table = HastyTable


class HoleyTable(StreamTable):
    """Takes whatever comes, holes or not."""

    def accept(self, stream_id: int, epoch: int, first_seq: int, last_seq: int) -> Accepted:
        self._accepted[stream_id, epoch] = max(first_seq - 1, self.accepted(stream_id, epoch))
        return super().accept(stream_id, epoch, first_seq, last_seq)


class HeedlessSession(Session):
    """Takes frames while it refuses them."""

    def refuse(self, reason: str, *, retry_after_ms: int) -> list[Event]:
        events = super().refuse(reason, retry_after_ms=retry_after_ms)
        for lane in self._lanes.values():
            lane.refusing = 0
        return events


class HoleyGateway(Gateway):
    table = HoleyTable
    session_type = HeedlessSession


class HoleyStore(SimStore):
    """Advances its watermark over holes."""

    def fits(self, first: int, last: int, mark: int) -> bool:
        return last > mark


class EagerGateway(Gateway):
    """Acknowledges what is on its way to the store."""

    def submit(self, event: object) -> None:
        super().submit(event)
        if isinstance(event, Arrived | RowsArrived | GapDeclared) and self.session is not None:
            (stream, epoch), _, last, _ = described(event)
            self.apply(self.session.committed([(stream, epoch, last)]))


class UnsyncedDisk(SimDisk):
    """Says that it has written before it has: the next process does not find each file's last write."""

    def append(self, name: str, offset: int, data: bytes) -> None:
        super().append(name, offset, data)
        self.unsynced = {**getattr(self, "unsynced", {}), name: offset}

    def names(self, folder: str) -> list[str]:
        for name, size in getattr(self, "unsynced", {}).items():
            self.files[name] = self.files.get(name, b"")[:size]
        self.unsynced: dict[str, int] = {}
        return super().names(folder)


class HastyOutbox(WatchedOutbox):
    """Counts a flush as accepted before it is run, whatever becomes of it."""

    def flush_job(self, name: str) -> FlushJob | None:
        job = super().flush_job(name)
        if job is not None:
            self.ledger.accept(job, self.state.era, dict(self.logs[name].last))
        return job


class ReusingOutbox(WatchedOutbox):
    """Gives the number of what could not be written to the next sample."""

    def refused(self, job: FlushJob, reason: str) -> None:
        streams = {stream: [item for item in queue if isinstance(item, Lost)] for stream, queue in job.streams.items()}
        self.ledger.accept(job, self.state.era, dict(self.logs[job.log].last))
        kept: dict[int, list[Sample | Lost]] = {stream: list(queue) for stream, queue in streams.items() if queue}
        super().refused(FlushJob(job.log, job.append, kept), reason)


class Gapless(RewriteJob):
    """Drops a segment and says nothing in its place."""

    __slots__ = ()

    def _gaps(self, frames: object, first: object) -> object:  # type: ignore[override]
        return iter(())


class GaplessOutbox(WatchedOutbox):
    def room_job(self, delivery: str) -> RewriteJob | None:
        job = super().room_job(delivery)
        if job is not None:
            job.__class__ = Gapless
        return job


class UnforkedTable(StreamTable):
    """The gateway does not care whose outbox speaks."""

    def forked(self, hello: link_pb2.Hello) -> bool:
        return False


class UnforkedGateway(Gateway):
    table = UnforkedTable


class TrustingOutbox(WatchedOutbox):
    """Takes whatever the gateway has as its own."""

    def resume(self, marks: object, writers: object = None) -> None:  # type: ignore[override]
        known = {(held.epoch, held.stream_id): held.last_seq for held in self.ranges()}
        capped = {key: min(seq, known[key]) for key, seq in marks.items() if key in known}  # type: ignore[attr-defined]
        super().resume(capped)


def agent_with(outbox: type[WatchedOutbox]) -> type[Agent]:
    """An agent on such an outbox."""
    return type("BrokenAgent", (Agent,), {"outbox_type": outbox})


# What is broken, the kinds of mishap it takes, and a seed from which on it shows soon; others show it, too.
MUTATIONS: dict[str, tuple[Parts, tuple[str, ...], int]] = {
    "a watermark of what is not stored": (Parts(gateway=HastyGateway), (), 186),
    "the gateway accepts holes": (Parts(gateway=HoleyGateway, store=HoleyStore), (), 62),
    "an ack before the commit": (Parts(gateway=EagerGateway), (), 11),
    "a disk that does not sync": (Parts(disk=UnsyncedDisk), (), 0),
    "accepted before it is synced": (Parts(agent=agent_with(HastyOutbox)), (), 0),
    "no gap for what could not be written": (Parts(agent=agent_with(ReusingOutbox)), (), 0),
    "no gap for what was dropped": (Parts(agent=agent_with(GaplessOutbox)), (), 0),
    "the gateway does not see forks": (Parts(gateway=UnforkedGateway), ("clone",), 8),
    "a copy trusts the gateway's numbers": (Parts(agent=agent_with(TrustingOutbox)), ("clone", "restore"), 104),
}


@pytest.mark.parametrize("mutation", MUTATIONS)
def test_a_broken_rule_is_found(mutation: str) -> None:
    parts, kinds, first = MUTATIONS[mutation]
    for seed in range(first, first + SEEDS):
        try:
            run_simulation(seed, kinds=kinds, parts=parts)
        except Exception:  # whatever breaks first
            return
    raise AssertionError(f"{SEEDS} worlds did not notice: {mutation}")


def test_the_unbroken_world_passes_the_same_seeds() -> None:
    for _, kinds, first in MUTATIONS.values():
        for seed in range(first, first + 2):
            run_simulation(seed, kinds=kinds)
