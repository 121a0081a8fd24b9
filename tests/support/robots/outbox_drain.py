"""What is left of an outbox directory, delivered in order to a store that takes no holes; and a check by a ledger."""

from __future__ import annotations

from edge_agent.outbox import LOGS, Frame, Kind, Outbox
from metaros._proto import link_pb2
from tests.support.simulation.sim_agent import Ledger
from tests.support.simulation.sim_gateway import SimStore

__all__ = ["check_ledger", "deliver", "stamps_of"]


def stamps_of(frame: Frame) -> list[int] | None:
    """A frame's samples by their stamps; None for a gap."""
    if frame.kind is Kind.GAP:
        return None
    batch = link_pb2.Batch if frame.kind is Kind.SAMPLES else link_pb2.MetricBatch
    return [int(stamp) for stamp in memoryview(batch.FromString(frame.body).stamps).cast("q")]


def deliver(outbox: Outbox, store: SimStore, *, most: int = 1 << 30, acknowledge: bool = True) -> int:
    """Send frames in each log's order, as a session does; how many."""
    count = 0
    outbox.resume({(epoch, stream): seq for (stream, epoch), seq in store.marks.items()})
    for held in outbox.ranges():
        key, mark = (held.stream_id, held.epoch), store.marks.get((held.stream_id, held.epoch), held.base_seq)
        store.marks[key] = max(mark, held.first_seq - 1)
        if held.first_seq > mark + 1:  # the gateway declares what nobody holds any more
            store.put(key, mark + 1, held.first_seq - 1, None, mark)
    for name in LOGS:
        while count < most and (taken := outbox.take(name)) is not None:
            frame, key = taken.frame, (taken.frame.stream_id, outbox.epoch_of(taken.era))
            mark = store.marks.get(key, 0)
            assert frame.first_seq <= mark + 1, f"{key}: {frame.first_seq} follows {mark}"
            if frame.last_seq > mark:
                store.put(key, frame.first_seq, frame.last_seq, stamps_of(frame), mark)
                store.marks[key] = frame.last_seq
            count += 1
    if acknowledge:
        for (stream, epoch), seq in store.marks.items():
            outbox.acknowledge(stream, epoch, seq)
    return count


def check_ledger(ledger: Ledger, store: SimStore) -> None:
    """Every accepted sample is stored under its number, or that is declared lost."""
    assert not ledger.cut, f"forgotten: {ledger.cut}"
    for stamp, place in ledger.places.items():
        key = ledger.final(place)
        row = store.rows.get(key, {}).get(place[2])
        assert row in (None, stamp), f"{key} {place[2]} is {row}, not {stamp}"
        assert row == stamp or place[2] in store.gaps.get(key, ()), f"{key} {place[2]}: neither stored nor declared"
