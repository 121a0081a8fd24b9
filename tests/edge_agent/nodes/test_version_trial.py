"""A bundle's new version proves itself, or the node goes back to the one that did."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from edge_agent.nodes.ledger import Ledger
from edge_agent.nodes.version_trial import VersionTrial

WALL = 1_700_000_000_000_000_000


def evaluate(trial: VersionTrial, now_s: float, *, ran_s: float = 0.0, **node: Any) -> str:
    shown = {
        "version": trial.trying,
        "state": "running",
        "crashes_total": 0,
        "since_ns": WALL - int(ran_s * 1e9),
        "last_exit": "",
        **node,
    }
    return trial.evaluate(shown, now_s=now_s, wall_ns=WALL, health_s=20.0, trial_s=180.0)


def tried(version: str = "2.0", good: str = "1.0") -> VersionTrial:
    trial = VersionTrial("b", good=good)
    trial.begin(version)
    assert trial.update(version, fetching=False)["state"] == "trying"
    return trial


def test_who_runs_long_enough_is_good() -> None:
    trial = tried()
    assert evaluate(trial, 0.0) == ""
    assert evaluate(trial, 19.0, ran_s=19.0) == ""
    assert evaluate(trial, 20.0, ran_s=20.0) == "healthy"
    assert trial.good == "2.0"
    assert trial.update("2.0", fetching=False)["state"] == "healthy"


def test_a_clock_that_jumps_ahead_makes_nobody_healthy() -> None:
    trial = tried()
    evaluate(trial, 0.0)
    assert evaluate(trial, 1.0, ran_s=1e6) == ""


def test_three_exits_send_it_back() -> None:
    trial = tried()
    evaluate(trial, 0.0, crashes_total=5)
    assert evaluate(trial, 1.0, crashes_total=7) == ""
    assert evaluate(trial, 2.0, crashes_total=8, last_exit="exit code 1") == "rolled_back"
    assert trial.choose("2.0") == "1.0"
    assert trial.choose("3.0") == "3.0"
    reported = trial.update("2.0", fetching=False)
    assert reported["state"] == "rolled_back"
    assert reported["code"] == "node_unhealthy"
    assert "exit code 1" in reported["message"]


def test_a_quarantine_and_a_wrong_configuration_send_it_back_at_once() -> None:
    for state in ("quarantined", "ended"):
        trial = tried()
        assert evaluate(trial, 0.0, state=state, last_exit="exit code 78") == "rolled_back"


def test_a_slow_death_is_no_health() -> None:
    trial = tried()
    for now_s in range(0, 180, 10):
        assert evaluate(trial, float(now_s), ran_s=9.0) == ""
    assert evaluate(trial, 181.0, ran_s=9.0) == "rolled_back"


def test_without_a_good_one_it_stays_where_it_is() -> None:
    trial = tried(good="")
    assert evaluate(trial, 0.0, state="quarantined", last_exit="exit code 1") == "rolled_back"
    assert trial.choose("2.0") == "2.0"


def test_a_stopped_node_proves_nothing_and_fails_nothing() -> None:
    trial = tried()
    evaluate(trial, 0.0)
    assert evaluate(trial, 1000.0, state="stopped", since_ns=0) == ""
    assert evaluate(trial, 1001.0, ran_s=1.0) == ""
    assert evaluate(trial, 1021.0, ran_s=21.0) == "healthy"


def test_the_old_version_still_running_is_not_judged() -> None:
    trial = tried()
    assert evaluate(trial, 0.0, version="1.0", state="quarantined") == ""


def test_another_version_forgives() -> None:
    trial = tried()
    evaluate(trial, 0.0, state="quarantined", last_exit="exit code 1")
    trial.forgive("2.0")
    assert trial.choose("2.0") == "1.0"
    trial.forgive("2.1")
    assert trial.choose("2.0") == "2.0"


def test_the_ledger_remembers(tmp_path: Path) -> None:
    ledger = Ledger(tmp_path)
    ledger.keep()
    assert not (tmp_path / "nodes.json").exists()
    trial = ledger.trial("n", "b")
    trial.good, trial.failed, trial.code, trial.message = "1.0", "2.0", "node_unhealthy", "why"
    ledger.keep()
    assert Ledger(tmp_path).trial("n", "b").choose("2.0") == "1.0"
    assert Ledger(tmp_path).trial("n", "other").good == ""
    (tmp_path / "nodes.json").write_text("[")
    assert Ledger(tmp_path).trial("n", "b").good == ""
