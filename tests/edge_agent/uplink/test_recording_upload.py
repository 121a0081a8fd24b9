"""Recordings on the back-fill lane: offered, sent from where they are wanted, within a window and the budget."""

from __future__ import annotations

import os
from pathlib import Path

import pytest

from edge_agent.blackbox.clip import Clip
from edge_agent.blackbox.recording_store import RecordingStore
from edge_agent.uplink.queues import Queues
from edge_agent.uplink.session import BACKFILL, LANES, AgentSession
from metaros._proto import link_pb2
from metaros.limits import Limits
from tests.edge_agent.session_rig import SessionRig
from tests.support.gateways.gateway_half import GatewayHalf

KIB, MIB = 1024, 1024 * 1024


def ident(number: int) -> str:
    return f"01HZZZZZZZZZZZZZZZZZZZZ{number:03d}"


class Half(GatewayHalf):
    """A gateway that says what it wants when it is told to."""

    def want(self, number: int, offset: int = 0, **more: bool) -> None:
        wanted = link_pb2.RecordingWanted(recording_id=ident(number), offset=offset, **more)
        self.out[BACKFILL].append(link_pb2.GatewayFrame(recording_wanted=wanted))


class Rig(SessionRig):
    """A session rig with a shelf."""

    half: Half

    def __init__(self, folder: Path) -> None:
        self.recordings = RecordingStore(folder)
        self.half = Half()
        super().__init__(self.half)
        self.budget.uplink_bytes_per_s = 1e8

    @property
    def queues(self) -> Queues:
        queues = super().queues
        return Queues(queues.channels, queues.outbox, queues.live, queues.linger, queues.budget, self.recordings)

    def add(self, number: int, data: bytes) -> None:
        self.recordings.draft(ident(number)).write_bytes(data)
        clip = Clip(size_bytes=len(data), sha256=bytes([number]) * 32, from_ns=5, to_ns=9, messages=7)
        self.recordings.add(self.recordings.keep(ident(number), clip, made_ns=number))

    def turn(self, seconds: float = 0.05) -> None:
        """Everything that may go goes, both ways."""
        for _ in range(200):
            self.clock.advance(seconds / 200)
            self.deliver()
            self.send()

    def got(self, number: int) -> bytes:
        """The parts of a recording, which follow each other."""
        data = b""
        for part in self.half.parts:
            if part.recording_id == ident(number):
                assert part.offset == len(data)
                data += part.data
        return data


@pytest.fixture
def rig(tmp_path: Path) -> Rig:
    return Rig(tmp_path)


def test_an_offer_says_everything_and_nothing_follows_before_it_is_wanted(rig: Rig) -> None:
    rig.add(1, b"x" * 1000)
    rig.connect()
    rig.turn()
    (offer,) = rig.half.offers
    assert (offer.recording_id, offer.offset, offer.data, offer.size_bytes) == (ident(1), 0, b"", 1000)
    assert (offer.sha256, offer.from_ns, offer.to_ns, offer.messages) == (b"\1" * 32, 5, 9, 7)
    assert (offer.failed, rig.half.parts) == ("", [])


def test_it_is_sent_whole_within_the_window_and_deleted_when_it_is_stored(rig: Rig) -> None:
    data = os.urandom(3 * MIB + 77)
    rig.connect()
    rig.add(1, data)  # while the session runs
    rig.turn()
    rig.half.want(1)
    rig.turn()
    assert len(rig.got(1)) == 1 * MIB, "the window is full"
    while len(rig.got(1)) < len(data):
        before = len(rig.got(1))
        rig.half.want(1, before)
        rig.turn()
        assert before < len(rig.got(1)) <= before + MIB
    assert rig.got(1) == data
    assert {(part.size_bytes, part.sha256) for part in rig.half.parts} == {(len(data), b"\1" * 32)}
    assert len(rig.recordings) == 1
    rig.half.want(1, len(data), stored=True)
    rig.turn()
    assert (len(rig.recordings), rig.recordings.was_here(ident(1))) == (0, True)


def test_no_progress_means_again_from_there(rig: Rig) -> None:
    data = os.urandom(600 * KIB)
    rig.add(1, data)
    rig.connect()
    rig.half.want(1)
    rig.turn()
    rig.half.want(1, 300 * KIB)
    rig.turn()
    assert rig.got(1) == data
    rig.half.parts.clear()
    rig.half.want(1, 300 * KIB)
    rig.turn()
    assert (rig.half.parts[0].offset, b"".join(p.data for p in rig.half.parts)) == (300 * KIB, data[300 * KIB :])
    rig.half.parts.clear()
    rig.half.want(1, 0)
    rig.turn()
    assert rig.got(1) == data


def test_the_next_session_offers_again_and_goes_on_where_the_gateway_says(rig: Rig) -> None:
    data = os.urandom(500 * KIB)
    rig.add(1, data)
    rig.connect()
    rig.half.want(1)
    rig.turn()
    rig.half.parts.clear()
    rig.new_session()
    rig.connect()
    rig.turn()
    assert (len(rig.half.offers), rig.half.parts) == (2, [])
    rig.half.want(1, 123_456)
    rig.turn()
    assert b"".join(part.data for part in rig.half.parts) == data[123_456:]


def test_unwanted_and_unknown_ones_and_nonsense(rig: Rig) -> None:
    rig.add(1, b"one")
    rig.add(2, b"two")
    rig.connect()
    rig.half.want(9, 5)
    rig.half.want(9, stored=True)
    rig.half.want(1, unwanted=True)
    rig.half.want(2, 1000)
    rig.turn()
    assert [saved.recording_id for saved in rig.recordings] == [ident(2)]
    assert rig.half.parts == []


def test_a_file_that_went_bad_is_reported_as_failed_once_a_session(rig: Rig) -> None:
    rig.add(1, b"x" * 1000)
    rig.connect()
    rig.turn()
    next(rig.recordings._folder.glob("*.mcap")).write_bytes(b"short")
    rig.half.want(1)
    rig.turn()
    assert [offer.failed for offer in rig.half.offers] == ["", "damaged"]
    assert rig.half.parts == []
    rig.half.want(1, unwanted=True)
    rig.turn()
    assert len(rig.recordings) == 0


def test_a_pause_of_the_lane_does_not_concern_recordings(rig: Rig) -> None:
    rig.add(1, b"x" * 1000)
    rig.connect()
    rig.half.refuse(BACKFILL, 7, retry_after_ms=60_000)
    rig.half.want(1)
    rig.turn()
    assert rig.got(1) == b"x" * 1000


def test_it_shares_the_lane_with_what_piled_up(rig: Rig) -> None:
    for number in range(100):
        rig.put("/bulk/a", os.urandom(50 * KIB) + bytes([number]), "bulk")
        rig.waiting()
    rig.add(1, os.urandom(900 * KIB))
    rig.connect()
    rig.half.want(1)
    frames = 0
    rig.deliver()
    while len(rig.got(1)) < 900 * KIB:
        rig.clock.advance(0.001)
        frames += rig.send(limit=1, lanes=(BACKFILL,))
        assert frames < 100
    assert rig.waiting() > 20, "neither waits for all of the other"


def test_the_budget_holds_and_parts_are_small_where_it_is(rig: Rig) -> None:
    rig.budget.set_limit(50_000, rig.clock.monotonic_s())
    rig.add(1, os.urandom(600 * KIB))
    rig.connect()
    rig.half.want(1)
    begin_s = rig.clock.monotonic_s()
    while rig.clock.monotonic_s() < begin_s + 10:
        rig.deliver()
        rig.send()
        wait_s = rig.session.wait_s(BACKFILL)
        rig.clock.advance(max(wait_s if wait_s is not None else 1.0, 1e-4))
        if rig.half.parts:
            rig.half.want(1, len(rig.got(1)))
    sent = len(rig.got(1))
    assert 0.5 * 35_000 * 10 <= sent <= 35_000 * 10 + 50 * KIB, "70 % of the budget"
    assert max(len(part.data) for part in rig.half.parts) <= 8 * KIB


def test_bulk_without_end_does_not_keep_a_recording_from_coming(rig: Rig) -> None:
    rig.budget.set_limit(50_000, rig.clock.monotonic_s())
    rig.add(1, os.urandom(600 * KIB))
    rig.connect()
    rig.half.want(1)
    begin_s, bulk, reported, produced = rig.clock.monotonic_s(), os.urandom(8 * KIB), 0, 0
    while (passed_s := rig.clock.monotonic_s() - begin_s) < 10:
        while produced < 80_000 * passed_s:
            rig.put("/bulk/a", bulk, "bulk")
            produced += len(bulk)
        rig.deliver()
        rig.send()
        waits = [wait_s for lane in LANES if (wait_s := rig.session.wait_s(lane)) is not None]
        rig.clock.advance(min(max(min(waits), 1e-4), 0.05))
        if len(rig.got(1)) > reported:
            reported = len(rig.got(1))
            rig.half.want(1, reported)
    assert reported > 0.5 * 35_000 * 10, "most of back-fill's share"


def test_an_agent_without_a_shelf_ignores_what_it_is_reported(tmp_path: Path) -> None:
    half = Half()
    rig = SessionRig(half)
    rig.connect()
    half.want(1)
    assert rig.deliver() == []
    assert isinstance(rig.session, AgentSession)
    assert Limits().recording_window_bytes == MIB
