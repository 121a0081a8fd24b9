"""The clock offset: right within half a round trip, and it notices a clock that was set."""

from __future__ import annotations

from hypothesis import given, settings
from hypothesis import strategies as st

from metaros.clock import ManualClock
from metaros.link import ClockOffset

AHEAD_S = 5.0


class Pair:
    """An agent and a gateway whose clock is ahead, with a delay each way."""

    def __init__(self, ahead_s: float = AHEAD_S) -> None:
        self.here, self.there = ManualClock(), ManualClock(monotonic_s=50.0)
        self.there.jump_wall(ahead_s)
        self.agent, self.gateway = ClockOffset(self.here), ClockOffset(self.there)

    def advance(self, seconds: float) -> None:
        self.here.advance(seconds)
        self.there.advance(seconds)

    def exchange(self, up_s: float, down_s: float, held_s: float = 0.0) -> None:
        beat = self.agent.beat()
        self.advance(up_s)
        self.gateway.received(beat.sent_ns, beat.echo_ns, beat.held_ns)
        self.advance(held_s)
        answer = self.gateway.beat()
        self.advance(down_s)
        self.agent.received(answer.sent_ns, answer.echo_ns, answer.held_ns)


def test_nothing_is_known_before_the_first_heartbeat() -> None:
    offset = ClockOffset(ManualClock())
    assert offset.offset_ns() is None
    assert offset.age_s(0) is None
    assert offset.round_trip_s is None
    assert offset.beat().echo_ns == 0


@settings(max_examples=50)
@given(st.lists(st.tuples(st.floats(0, 2), st.floats(0, 2), st.floats(0, 10)), min_size=1, max_size=20))
def test_the_error_is_at_most_half_the_least_round_trip(exchanges: list[tuple[float, float, float]]) -> None:
    pair = Pair()
    for up_s, down_s, held_s in exchanges:
        pair.exchange(up_s, down_s, held_s)
    offset_ns, round_trip_s = pair.agent.offset_ns(), pair.agent.round_trip_s
    assert offset_ns is not None
    assert round_trip_s is not None
    assert abs(offset_ns / 1e9 - AHEAD_S) <= round_trip_s / 2 + 1e-6


def test_age_of_a_peers_stamp() -> None:
    pair = Pair()
    pair.exchange(0.01, 0.01)
    stamp_ns = pair.there.wall_ns()
    pair.advance(0.4)
    age_s = pair.agent.age_s(stamp_ns)
    assert age_s is not None
    assert abs(age_s - 0.4) < 0.001


def test_setting_our_own_clock_changes_no_age() -> None:
    pair = Pair()
    pair.exchange(0.01, 0.01)
    stamp_ns = pair.there.wall_ns()
    pair.here.jump_wall(-3600)
    pair.advance(0.2)
    age_s = pair.agent.age_s(stamp_ns)
    assert age_s is not None
    assert abs(age_s - 0.2) < 0.001


def test_a_peer_that_sets_its_clock_is_followed_by_the_next_exchange() -> None:
    pair = Pair()
    for _ in range(5):
        pair.exchange(0.001, 0.001)
    pair.there.jump_wall(-100)
    pair.exchange(0.2, 0.2)
    age_s = pair.agent.age_s(pair.there.wall_ns())
    assert age_s is not None
    assert abs(age_s) < 0.25


def test_before_a_round_trip_arrival_stands_in() -> None:
    pair = Pair()
    stamp_ns = pair.there.wall_ns()
    pair.advance(0.05)
    pair.agent.saw(stamp_ns)
    assert pair.agent.age_s(stamp_ns) == 0.0
    pair.advance(0.5)
    assert round(pair.agent.age_s(stamp_ns) or 0, 3) == 0.5
    assert pair.agent.round_trip_s is None


def test_old_exchanges_are_forgotten() -> None:
    pair = Pair()
    pair.exchange(0.001, 0.001)
    pair.advance(301)
    pair.exchange(0.1, 0.1)
    assert pair.agent.round_trip_s is not None
    assert abs(pair.agent.round_trip_s - 0.2) < 1e-6


def test_a_foreign_or_impossible_echo_is_ignored() -> None:
    clock = ManualClock()
    offset = ClockOffset(clock)
    beat = offset.beat()
    offset.received(clock.wall_ns(), 12345, 0)
    offset.received(clock.wall_ns(), beat.sent_ns, -1)
    offset.received(clock.wall_ns(), beat.sent_ns, 10**12)
    assert offset.round_trip_s is None


def test_beats_of_one_instant_stay_apart() -> None:
    offset = ClockOffset(ManualClock())
    assert len({offset.beat().sent_ns for _ in range(40)}) == 40
