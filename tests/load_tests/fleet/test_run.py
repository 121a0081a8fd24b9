"""Scenarios at work, small: a real gateway process, robots over every transport, reports, and a store that was cut."""

from __future__ import annotations

import asyncio
import json
import sqlite3
from pathlib import Path
from random import Random  # noqa: TID251 - seeded
from typing import Any

import pytest

from load_tests.benchmarks.gateway.fleet import SCENARIOS, chosen, main
from load_tests.fleet.conclude import conclude
from load_tests.fleet.load import Load
from load_tests.fleet.run import Setting, running
from load_tests.fleet.verify import verify
from load_tests.report.record import Record, machine, save

SMALL = (
    ["storm"],
    ["chaos"],
    ["viewers", "--seconds", "1", "--cut-s", "1"],
    *(["steady", "--transport", name, "--idle", "2", "--active", "3", "--seconds", "1"] for name in ("ws", "aio")),
)
LOAD = Load(name="some", period_s=0.2, rows=4, samples=2, sample_bytes=100)


@pytest.mark.integration
@pytest.mark.timeout(180)
def test_the_quick_sample_keeps_its_promise_and_writes_a_report(tmp_path: Path) -> None:
    figures, earlier = tmp_path / "fleet.json", tmp_path / "earlier.json"
    save(Record("steady", "", "", machine(), [{"gateway_cores": 0.5}]), earlier)
    words = ["--quick", "--quiet", "--idle", "8", "--active", "4", "--seconds", "2", "--json", str(figures)]
    assert main([*words, "--against", str(earlier)]) == 0
    found = json.loads(figures.read_text())["rounds"][0]
    assert found["accepted"] == found["stored"] > 0
    assert found["gateway_cores"] > 0
    assert found["links_ended"] == {}
    shown = (tmp_path / "fleet.html").read_text()
    assert "<svg" in shown
    assert "Compared with" in shown


@pytest.mark.integration
@pytest.mark.timeout(180)
async def test_scenarios_and_other_transports_small() -> None:
    """Each with a gateway of its own, beside each other: they wait most of the time. Speed is not what is tested."""
    records: dict[str, Record] = {}
    async with asyncio.TaskGroup() as group:
        for words in SMALL:
            options = chosen([*words, "--quick"])
            record = records[" ".join(words)] = Record(options.scenario, "", "", machine())
            setting = Setting(transport=options.transport, quiet=True, warm=True)
            group.create_task(SCENARIOS[options.scenario][0](setting, options, record))  # type: ignore[arg-type]
    assert {
        name: [(found["lost"], found["duplicated"], found["not_acknowledged"]) for found in record.rounds]
        for name, record in records.items()
    } == {name: [(0, 0, 0)] for name in records}
    (watched,) = (record.rounds[0] for record in records.values() if record.scenario == "viewers")
    assert watched["deliveries_per_s"] > 0
    links = [goal for record in records.values() if record.scenario == "steady" for goal in record.rounds[0]["goals"]]
    assert [goal["text"] for goal in links if not goal["met"]] == []


@pytest.mark.integration
@pytest.mark.timeout(180)
async def test_what_is_missing_in_the_store_or_there_twice_is_found(tmp_path: Path) -> None:
    figures: dict[str, Any] = {}
    async with running(Setting(quiet=True, warm=True), figures) as run:
        await run.simulator.join([LOAD] * 3, per_s=50.0)
        stored = run.simulator.counts
        assert await run.simulator.until(lambda: stored.stored > 30, timeout_s=60)
        await conclude(run, figures)
        assert (figures["lost"], figures["duplicated"]) == (0, 0)
        database = run.gateway.data_dir / "gateway.sqlite"
        with sqlite3.connect(database) as changed:
            (count,) = changed.execute("SELECT count FROM sample_batches ORDER BY batch LIMIT 1").fetchone()
            changed.execute("DELETE FROM sample_batches WHERE batch = (SELECT min(batch) FROM sample_batches)")
        verdict = verify(database, run.simulator.robots)
        assert verdict.lost >= count
        with sqlite3.connect(database) as changed:
            columns = "robot, count, stored_ns, series, stamps, vals"
            changed.execute(f"INSERT INTO metric_batches ({columns}) SELECT {columns} FROM metric_batches LIMIT 1")
        assert verify(database, run.simulator.robots).duplicated >= 4


def test_an_unreadable_report_to_compare_with_is_reported(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
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
