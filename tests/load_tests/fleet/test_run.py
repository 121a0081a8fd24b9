"""Scenarios at work, small: a real gateway process, robots over every transport, reports, and a store that was cut."""

from __future__ import annotations

import json
import sqlite3
from pathlib import Path
from random import Random  # noqa: TID251 - seeded
from typing import Any

import pytest

from load_tests.bench_fleet import main
from load_tests.fleet.conclude import conclude
from load_tests.fleet.load import Load
from load_tests.fleet.run import Setting, running
from load_tests.fleet.steady import steady
from load_tests.fleet.verify import verify

LOAD = Load(name="some", period_s=0.2, rows=4, samples=2, sample_bytes=100)


@pytest.mark.integration
@pytest.mark.timeout(180)
def test_the_quick_sample_keeps_its_promise_and_writes_a_report(tmp_path: Path) -> None:
    figures = tmp_path / "fleet.json"
    assert main(["--quick", "--quiet", "--idle", "8", "--active", "4", "--json", str(figures)]) == 0
    found = json.loads(figures.read_text())["rounds"][0]
    assert found["accepted"] == found["stored"] > 0
    assert found["gateway_cores"] > 0
    assert found["links_ended"] == {}
    assert "<svg" in (tmp_path / "fleet.html").read_text()
    again = ["--quick", "--quiet", "--idle", "2", "--active", "1", "--json", str(tmp_path / "b.json")]
    assert main([*again, "--against", str(figures)]) == 0
    assert "Compared with" in (tmp_path / "b.html").read_text()


@pytest.mark.integration
@pytest.mark.timeout(180)
@pytest.mark.parametrize("transport", ["ws", "aio"])
async def test_other_transports_carry_the_same_link(transport: str) -> None:
    figures: dict[str, Any] = {}
    setting = Setting(transport=transport, quiet=True)
    await steady(setting, figures, idle=2, active=3, load=LOAD, seconds=1.0, ramp_per_s=50.0)
    assert [goal["text"] for goal in figures["goals"] if not goal["met"]] == []


@pytest.mark.integration
@pytest.mark.timeout(180)
@pytest.mark.parametrize("words", [["storm"], ["chaos"], ["viewers", "--seconds", "1"]])
def test_scenarios_run_small(words: list[str], tmp_path: Path) -> None:
    main([*words, "--quick", "--quiet", "--json", str(tmp_path / "fleet.json")])  # speed is not what is tested here
    found = json.loads((tmp_path / "fleet.json").read_text())
    assert not found["interrupted"]
    for figures in found["rounds"]:
        assert (figures["lost"], figures["duplicated"], figures["not_acknowledged"]) == (0, 0, 0)


@pytest.mark.integration
@pytest.mark.timeout(180)
async def test_what_is_missing_in_the_store_or_there_twice_is_found(tmp_path: Path) -> None:
    figures: dict[str, Any] = {}
    async with running(Setting(quiet=True), figures) as run:
        await run.crowd.join([LOAD] * 3, per_s=50.0)
        stored = run.crowd.counts
        assert await run.crowd.until(lambda: stored.stored > 30, timeout_s=60)
        await conclude(run, figures)
        assert (figures["lost"], figures["duplicated"]) == (0, 0)
        database = run.gateway.data_dir / "gateway.sqlite"
        with sqlite3.connect(database) as changed:
            (count,) = changed.execute("SELECT count FROM sample_batches ORDER BY batch LIMIT 1").fetchone()
            changed.execute("DELETE FROM sample_batches WHERE batch = (SELECT min(batch) FROM sample_batches)")
        verdict = verify(database, run.crowd.robots)
        assert verdict.lost >= count
        with sqlite3.connect(database) as changed:
            columns = "robot, count, stored_ns, series, stamps, vals"
            changed.execute(f"INSERT INTO metric_batches ({columns}) SELECT {columns} FROM metric_batches LIMIT 1")
        assert verify(database, run.crowd.robots).duplicated >= 4


def test_an_unreadable_report_to_compare_with_is_told(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (tmp_path / "odd.json").write_text("[]")
    assert main(["--quick", "--against", str(tmp_path / "odd.json")]) == 2
    assert "is no report" in capsys.readouterr().err


def test_loads_say_what_they_are_and_are_what_they_say() -> None:
    from load_tests.fleet.load import metric_body, sample_body
    from metaros._proto import link_pb2

    assert LOAD.describe() == "20 rows/s, 10 samples/s of 100 B, a batch of each every 0.2 s"
    rng = Random(1)
    first = rng.randrange(1, 10**6)
    rows = link_pb2.MetricBatch.FromString(metric_body(first, 7, 10**18, period_ns=10**9))
    assert len(rows.series_ids) == 28
    assert len(rows.values) == len(rows.stamps) == 56
    batch = link_pb2.Batch.FromString(sample_body(first, 3, 100, 10**18))
    assert len(batch.payload) == 300
    assert batch.payload[:8] == first.to_bytes(8, "little")
