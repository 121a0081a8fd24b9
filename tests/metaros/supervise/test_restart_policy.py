"""The restart policy, exhaustively: it is pure, so time is a number and chance is seeded."""

from __future__ import annotations

import signal
from random import Random  # noqa: TID251  (seeded, as the policy's argument)

import pytest

from metaros.clock import ManualClock
from metaros.supervise.restart_policy import Exit, History, Quarantine, Restart, RestartAt, RestartPolicy, Stop, decide
from tests.support.tables import cases

CRASH = Exit(code=1)


def crash(history: History, clock: ManualClock, rng: Random, policy: RestartPolicy, *, after_s: float) -> tuple:
    """Run for `after_s`, die, and ask."""
    history = history.started(clock.monotonic_s())
    clock.advance(after_s)
    return decide(history, CRASH, clock.monotonic_s(), rng, policy)


def test_the_first_restart_comes_at_once(clock: ManualClock) -> None:
    for seed in range(200):
        decision, _ = decide(History(), CRASH, 100.0, Random(seed))
        assert isinstance(decision, RestartAt)
        assert 100.0 <= decision.at <= 100.05
        assert not decision.safe_stop


@pytest.mark.parametrize("seed", range(20))
def test_delays_double_up_to_the_cap_with_a_fifth_of_jitter(clock: ManualClock, seed: int) -> None:
    policy = RestartPolicy(window_exits=1000)
    rng = Random(seed)
    history = History()
    for number in range(80):
        decision, history = crash(history, clock, rng, policy, after_s=0.01)
        assert isinstance(decision, RestartAt)
        delay = decision.at - clock.monotonic_s()
        nominal = min(0.1 * 2.0 ** (number - 1), 30.0)
        if number:
            assert 0.8 * nominal - 1e-6 <= delay <= 1.2 * nominal + 1e-6
        else:
            assert delay <= 0.05


def test_a_healthy_minute_starts_from_the_beginning(clock: ManualClock) -> None:
    policy = RestartPolicy()
    rng = Random(1)
    history = History()
    for _ in range(5):
        _, history = crash(history, clock, rng, policy, after_s=0.1)
    assert history.restarts == 5
    decision, history = crash(history, clock, rng, policy, after_s=60.5)
    assert isinstance(decision, RestartAt)
    assert decision.at - clock.monotonic_s() <= 0.05
    assert history.restarts == 1


def test_just_under_a_minute_is_not_healthy(clock: ManualClock) -> None:
    _, history = crash(History(), clock, Random(1), RestartPolicy(), after_s=59.9)
    _, history = crash(history, clock, Random(1), RestartPolicy(), after_s=59.9)
    assert history.restarts == 2


def test_the_eleventh_exit_within_five_minutes_is_a_quarantine(clock: ManualClock) -> None:
    policy = RestartPolicy()
    history = History()
    for _ in range(10):
        decision, history = crash(history, clock, Random(1), policy, after_s=1.0)
        assert isinstance(decision, RestartAt)
    decision, history = crash(history, clock, Random(1), policy, after_s=1.0)
    assert decision == Quarantine(clock.monotonic_s() + 300.0, 11)


def test_exits_leave_the_window(clock: ManualClock) -> None:
    policy = RestartPolicy()
    history = History()
    for _ in range(100):
        decision, history = crash(history, clock, Random(1), policy, after_s=31.0)
        assert isinstance(decision, RestartAt)
    assert len(history.exits) <= 10


def test_a_try_out_of_quarantine_is_one_try(clock: ManualClock) -> None:
    history = History()
    for _ in range(11):
        decision, history = decide(history.started(clock.monotonic_s()), Exit(code=1), clock.monotonic_s(), Random(1))
    assert isinstance(decision, Quarantine)
    clock.advance(300.0)
    history = history.started(clock.monotonic_s())
    clock.advance(2.0)  # all earlier exits are out of the window
    decision, history = decide(history, Exit(code=1), clock.monotonic_s(), Random(1))
    assert isinstance(decision, Quarantine)
    assert history.quarantined


def test_a_quarantined_process_that_is_well_again_restarts_fast(clock: ManualClock) -> None:
    policy = RestartPolicy()
    history = History()
    for _ in range(11):
        decision, history = crash(history, clock, Random(1), policy, after_s=1.0)
    clock.advance(300.0)
    decision, history = crash(history, clock, Random(1), policy, after_s=3600.0)
    assert isinstance(decision, RestartAt)
    assert decision.at - clock.monotonic_s() <= 0.05
    assert len(history.exits) == 1


def test_a_critical_process_is_never_given_up_but_asks_for_a_safe_stop(clock: ManualClock) -> None:
    policy = RestartPolicy(critical=True)
    history = History()
    decisions = []
    for _ in range(30):
        decision, history = crash(history, clock, Random(1), policy, after_s=1.0)
        decisions.append(decision)
    assert all(isinstance(decision, RestartAt) for decision in decisions)
    assert [decision.safe_stop for decision in decisions] == [False] * 10 + [True] * 20


@cases("restart", list(Restart))
@cases("critical", [False, True])
def test_a_configuration_error_is_final(restart: Restart, critical: bool) -> None:
    policy = RestartPolicy(restart=restart, critical=critical)
    decision, _ = decide(History(), Exit(code=78), 1.0, Random(1), policy)
    assert isinstance(decision, Stop)
    assert "configuration" in decision.reason


@cases(
    ("restart", "exit_", "stops"),
    [
        (Restart.ALWAYS, Exit(code=0), False),
        (Restart.ALWAYS, Exit(code=1), False),
        (Restart.ALWAYS, Exit(signal=9), False),
        (Restart.ON_FAILURE, Exit(code=0), True),
        (Restart.ON_FAILURE, Exit(code=1), False),
        (Restart.ON_FAILURE, Exit(signal=11), False),
        (Restart.NEVER, Exit(code=0), True),
        (Restart.NEVER, Exit(code=1), True),
        (Restart.NEVER, Exit(signal=9), True),
    ],
)
def test_the_words_of_systemd(restart: Restart, exit_: Exit, stops: bool) -> None:
    decision, _ = decide(History(), exit_, 1.0, Random(1), RestartPolicy(restart=restart))
    assert isinstance(decision, Stop) is stops


def test_the_same_seed_gives_the_same_decisions() -> None:
    def run(seed: int) -> list[object]:
        clock, rng, history, found = ManualClock(), Random(seed), History(), []
        for _ in range(15):
            decision, history = crash(history, clock, rng, RestartPolicy(), after_s=0.5)
            found.append(decision)
        return found

    assert run(7) == run(7)
    assert run(7) != run(8)


@cases(
    ("returncode", "reason"),
    [
        (0, "exited"),
        (3, "exit code 3"),
        (-signal.SIGKILL, "killed by SIGKILL"),
        (-signal.SIGSEGV, "killed by SIGSEGV"),
        (-63, "killed by signal 63"),
    ],
)
def test_an_exit_in_words(returncode: int, reason: str) -> None:
    assert Exit.from_returncode(returncode).reason == reason
