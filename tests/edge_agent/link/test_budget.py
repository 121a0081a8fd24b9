"""The byte budget over links of all speeds: the limit holds, who matters more goes first, back-fill leaves room."""

from __future__ import annotations

import random  # noqa: TID251 - seeded
from collections import deque
from dataclasses import dataclass, field

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from edge_agent.link.budget import BACKFILL_SHARE, Budget, Use

MBIT = 125_000
FRAME = 256 * 1024
TICK_S = 0.01


@dataclass
class Link:
    """A pipe of a capacity with a buffer without end; what came through is acknowledged after the round trip."""

    bytes_per_s: float
    rtt_s: float = 0.05
    queue: deque[tuple[Use, int, float]] = field(default_factory=deque)
    acks: deque[tuple[float, Use, int, float]] = field(default_factory=deque)
    carried: dict[Use, int] = field(default_factory=dict)
    _room: float = 0.0

    @property
    def queued_bytes(self) -> int:
        return sum(size for _, size, _ in self.queue)

    def tick(self, budget: Budget, now_s: float) -> None:
        """Carry what a tick allows, and deliver acknowledgements."""
        self._room += self.bytes_per_s * TICK_S
        while self.queue and self._room >= self.queue[0][1]:
            use, size, sent_s = self.queue.popleft()
            self._room -= size
            self.acks.append((now_s + self.rtt_s, use, size, sent_s))
        if not self.queue:
            self._room = min(self._room, 0.0)
        while self.acks and self.acks[0][0] <= now_s:
            _, use, size, sent_s = self.acks.popleft()
            self.carried[use] = self.carried.get(use, 0) + size
            if use is Use.BACKFILL:
                budget.backfilled(size, now_s, delay_s=now_s - sent_s)


def run(
    budget: Budget,
    link: Link,
    *,
    seconds: float,
    fresh_bytes_per_s: float = 0.0,
    frame: int = 8192,
    start_s: float = 0.0,
) -> list[tuple[float, int]]:
    """Back-fill without end, beside fresh data that comes steadily; how much the link had queued at each tick."""
    waiting, queued = 0.0, []
    for tick in range(round(seconds / TICK_S)):
        now_s = start_s + tick * TICK_S
        waiting += fresh_bytes_per_s * TICK_S
        while waiting >= 1000 and budget.room(Use.METRIC, now_s) > 0:
            waiting -= 1000
            budget.spend(Use.METRIC, 1000, now_s)
            link.queue.append((Use.METRIC, 1000, now_s))
        while budget.room(Use.BACKFILL, now_s) > 0:
            budget.backfill_taken(frame, now_s)
            budget.spend(Use.BACKFILL, frame, now_s)
            link.queue.append((Use.BACKFILL, frame, now_s))
        link.tick(budget, now_s)
        queued.append((now_s, link.queued_bytes))
    return queued


@pytest.mark.parametrize(("mbit", "rtt_s"), [(0.1, 0.002), (0.1, 0.3), (1, 0.05), (8, 0.05), (50, 0.002), (50, 0.3)])
def test_backfill_finds_a_links_speed_and_takes_its_share(mbit: float, rtt_s: float) -> None:
    budget, link = Budget(now_s=0.0), Link(mbit * MBIT, rtt_s=rtt_s)
    settled_s = 120.0 if mbit < 1 else 30.0
    run(budget, link, seconds=settled_s)
    before = link.carried[Use.BACKFILL]
    queued = run(budget, link, seconds=40, start_s=settled_s)
    share = (link.carried[Use.BACKFILL] - before) / (40 * link.bytes_per_s)
    assert 0.5 < share <= BACKFILL_SHARE + 0.02
    assert budget.uplink_bytes_per_s == pytest.approx(link.bytes_per_s, rel=0.3)
    empty = sum(size <= 2 * 8192 for _, size in queued) / len(queued)
    assert empty > 0.6, "most of the time nothing is in fresh data's way"


def test_backfill_of_large_frames_on_a_slow_link() -> None:
    budget, link = Budget(now_s=0.0), Link(MBIT)
    run(budget, link, seconds=200, frame=1 << 20)
    before = link.carried[Use.BACKFILL]
    run(budget, link, seconds=600, frame=1 << 20, start_s=200)
    assert 0.4 < (link.carried[Use.BACKFILL] - before) / (600 * MBIT) < 0.85


def test_backfill_grows_without_end_where_the_link_has_none() -> None:
    budget, link = Budget(now_s=0.0), Link(1e12, rtt_s=0.001)
    run(budget, link, seconds=20, frame=1 << 20)
    assert budget.backfill_bytes_per_s > 100e6


def test_backfill_yields_to_fresh_data_on_a_full_link() -> None:
    budget, link = Budget(now_s=0.0), Link(MBIT)
    run(budget, link, seconds=60, fresh_bytes_per_s=60_000)
    queued = run(budget, link, seconds=60, fresh_bytes_per_s=60_000, start_s=60)
    assert sum(size for _, size in queued) / len(queued) < MBIT, "fresh data waits less than a second on average"
    assert link.carried[Use.METRIC] > 0.97 * 60_000 * 120 - 2 * MBIT
    assert link.carried[Use.BACKFILL] > 0.2 * 60_000 * 120


def test_backfill_follows_a_link_that_becomes_slower_and_faster() -> None:
    budget, link = Budget(now_s=0.0), Link(8 * MBIT)
    run(budget, link, seconds=60)
    link.bytes_per_s = MBIT
    run(budget, link, seconds=60, start_s=60)
    assert budget.uplink_bytes_per_s == pytest.approx(MBIT, rel=0.35)
    link.bytes_per_s = 8 * MBIT
    run(budget, link, seconds=120, start_s=120)
    assert budget.uplink_bytes_per_s == pytest.approx(8 * MBIT, rel=0.35)


def test_a_link_without_an_answer_is_not_flooded() -> None:
    budget, link = Budget(now_s=0.0), Link(0.0)
    run(budget, link, seconds=60)
    assert link.queued_bytes < 1_500_000


def test_what_a_small_backlog_needs_says_nothing_about_the_link() -> None:
    budget = Budget(now_s=0.0)
    for second in range(1, 30):
        budget.backfill_taken(1000, second)
        budget.spend(Use.BACKFILL, 1000, second)
        budget.backfilled(1000, second + 0.1, delay_s=0.1)
    assert budget.uplink_bytes_per_s == 250_000


@settings(max_examples=30, deadline=None)
@given(
    seed=st.integers(0, 2**32),
    limit=st.integers(1000, 20_000_000),
    frame=st.integers(100, FRAME),
    greedy=st.sets(st.sampled_from(list(Use)), min_size=1),
)
def test_the_limit_holds_over_any_second(seed: int, limit: int, frame: int, greedy: set[Use]) -> None:
    """Everybody sends whenever there is room, at odd times, after an idle time too."""
    rng, budget, now_s = random.Random(seed), Budget(limit_bytes_per_s=limit, now_s=0.0), 10.0
    uses = sorted(greedy - {Use.COMMAND}, key=lambda use: use.value)
    sent: deque[tuple[float, int]] = deque()
    burst = max(16 * 1024, limit // 20)
    for _ in range(1000):
        now_s += rng.choice([0.0, 0.001, 0.02, 0.1])
        for use in uses:
            if budget.room(use, now_s) > 0:
                size = rng.randint(1, frame)
                budget.spend(use, size, now_s)
                sent.append((now_s, size))
        while sent and sent[0][0] < now_s - 1.0:
            sent.popleft()
        assert sum(size for _, size in sent) <= limit + 2 * frame + 2 * burst


def test_the_limit_is_used() -> None:
    budget, total = Budget(limit_bytes_per_s=100_000, now_s=0.0), 0
    for tick in range(10_000):
        while budget.room(Use.BULK, tick / 1000) > 0:
            budget.spend(Use.BULK, 1000, tick / 1000)
            total += 1000
    assert total == pytest.approx(1_000_000, rel=0.03)


def test_events_and_results_go_whatever_others_owe() -> None:
    budget = Budget(limit_bytes_per_s=10_000, now_s=0.0)
    budget.spend(Use.BULK, 1 << 20, 0.0)
    assert budget.room(Use.EVENT, 0.0) > 0
    assert budget.room(Use.COMMAND, 0.0) > 0
    assert budget.room(Use.LIVE, 60.0) <= 0
    for _ in range(20):
        budget.spend(Use.COMMAND, 1000, 0.0)
    assert budget.room(Use.COMMAND, 0.0) > 0


def test_under_a_tight_limit_those_who_matter_more_go_first() -> None:
    budget, sent = Budget(limit_bytes_per_s=50_000, now_s=0.0), dict.fromkeys(Use, 0)
    order = [Use.BACKFILL, Use.BULK, Use.METRIC, Use.LIVE, Use.EVENT]  # who matters least asks first
    for tick in range(5_000):
        for use in order:
            while budget.room(use, tick / 250) > 0:
                budget.spend(use, 500, tick / 250)
                sent[use] += 500
    assert sent[Use.EVENT] > 900_000, "events alone may fill the limit"
    assert max(sent[use] for use in order[:-1]) < 40_000
    sent = dict.fromkeys(Use, 0)
    for tick in range(5_000, 10_000):
        for use in order[:-1]:
            wanted = {Use.LIVE: 10_000, Use.METRIC: 20_000}.get(use, 1 << 30) * (tick - 5_000) / 250
            while sent[use] + 500 <= wanted and budget.room(use, tick / 250) > 0:
                budget.spend(use, 500, tick / 250)
                sent[use] += 500
    assert sent[Use.LIVE] > 0.95 * 200_000
    assert sent[Use.METRIC] > 0.95 * 400_000
    assert sent[Use.BULK] > 0.8 * (1_000_000 - 600_000)
    assert sent[Use.BACKFILL] < 40_000


def test_backfill_uses_the_share_of_a_limit_and_the_limit_may_change() -> None:
    budget, link = Budget(limit_bytes_per_s=100_000, now_s=0.0), Link(1e9)
    run(budget, link, seconds=30)
    assert link.carried[Use.BACKFILL] == pytest.approx(30 * 70_000, rel=0.1)
    budget.set_limit(0, 30.0)
    run(budget, link, seconds=10, start_s=30)
    assert link.carried[Use.BACKFILL] > 20e6


@settings(max_examples=100, deadline=None)
@given(limit=st.integers(0, 10**9), spends=st.lists(st.tuples(st.sampled_from(list(Use)), st.integers(0, 1 << 24))))
def test_waiting_never_spins_and_ends_with_room(limit: int, spends: list[tuple[Use, int]]) -> None:
    budget, now_s = Budget(limit_bytes_per_s=limit, now_s=0.0), 0.0
    for use, size in spends:
        budget.spend(use, size, now_s)
        now_s += 0.01
    waits = {use: budget.wait_s(use, now_s) for use in Use}
    for use, wait_s in waits.items():
        assert (wait_s > 0) == (budget.room(use, now_s) <= 0)
    for use, wait_s in sorted(waits.items(), key=lambda item: item[1]):
        if use is not Use.BACKFILL:
            assert budget.room(use, now_s + 1.01 * wait_s) > 0


def test_a_clock_that_goes_back_gives_nothing() -> None:
    budget = Budget(limit_bytes_per_s=1000, now_s=100.0)
    budget.spend(Use.LIVE, 50_000, 100.0)
    room = budget.room(Use.LIVE, 100.0)
    assert budget.room(Use.LIVE, 50.0) == room
    assert budget.room(Use.LIVE, 100.0) == room
