"""Which stored rows are judged after a state: those that may have come since, ten minutes of them at most."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np

from gateway.alerting.watch.bands import Bands
from gateway.alerting.watch.evaluation import EvaluationThread
from gateway.alerting.watch.handover import AHEAD_NS, BACK_NS, Handover, ReplayWindow
from gateway.alerting.watch.intake import Intake
from gateway.alerting.watch.pending_rows import PendingRows
from gateway.alerting.watch.watch_files import WatchFiles
from gateway.store.alerting.watch_states import Saved
from metaros.clock import ManualClock
from tests.gateway.alerting.watch.made import entry

S = 10**9
NOW = 1_700_000_000 * S
STATE = Saved(robot="r1", fence=1, version=1, saved_ns=NOW, newest_ns=NOW - 3600 * S, marks={}, state=b"x")


def test_rows_since_the_state_by_the_robots_own_clock() -> None:
    window = ReplayWindow.after(STATE, NOW + 20 * S)
    assert (window.start_ns, window.end_ns) == (STATE.newest_ns - BACK_NS, STATE.newest_ns + 20 * S + AHEAD_NS)
    assert window.skipped_s == 0.0
    set_back = ReplayWindow.after(STATE, NOW - 500 * S)  # the calendar was
    assert set_back.start_ns <= STATE.newest_ns <= set_back.end_ns


def test_what_is_older_than_ten_minutes_is_left_out_and_declared() -> None:
    window = ReplayWindow.after(STATE, NOW + 4200 * S)
    assert (window.start_ns, window.skipped_s) == (STATE.newest_ns + 3600 * S, 3600.0)


def test_without_a_state_there_is_nothing_to_go_on_from() -> None:
    for state in (None, replace(STATE, version=0), replace(STATE, newest_ns=0)):
        window = ReplayWindow.after(state, NOW)
        assert window.start_ns > window.end_ns


def test_a_clock_at_either_end_of_all_stamps_asks_for_none_beyond() -> None:
    for newest_ns in (2**63 - 1, -(2**63)):
        window = ReplayWindow.after(replace(STATE, newest_ns=newest_ns), NOW + 20 * S)
        assert -(2**63) <= window.start_ns <= newest_ns <= window.end_ns < 2**63


def test_the_newest_row_of_a_clock_at_the_beginning_of_all_stamps_can_be_stored(tmp_path: Path) -> None:
    intake = Intake(WatchFiles(tmp_path))
    evaluation = EvaluationThread(intake, Bands(), clock=ManualClock())
    evaluator = evaluation.state_machine.evaluator
    evaluator.samples(np.array([evaluator.slot("r1", "a.x")]), np.array([-(2**63) / 1e9]), np.ones(1))
    evaluator.tick(0.0)
    (state,) = Handover(evaluation, intake).dump({"r1": 1}, most_bytes=1e9, now_ns=NOW)
    assert state.newest_ns == -(2**63)


def test_rows_that_were_judged_remote_are_not_judged_again() -> None:
    pending = PendingRows()
    for first_seq in (1, 11, 21):
        pending.add(entry(first_seq, 10))
    pending.add(entry(1, 5, robot="r2"))
    pending.skip({("r1", 0, 7): 15})
    taken = pending.take({("r1", 0, 7): 30})
    assert [row for part, span in taken for row in part.values[span].tolist()] == [float(n) for n in range(16, 31)]
    pending.add(entry(31, 10))
    pending.forget("r1")
    assert (pending.rows, dict(pending.judged)) == (5, {})
    assert pending.take({("r1", 0, 7): 40}) == []
    assert len(pending.take({("r2", 0, 7): 5})) == 1
