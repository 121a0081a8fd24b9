"""The benchmark of storage with a few seconds of two robots: that everything is counted."""

from __future__ import annotations

from pathlib import Path

import pytest

from edge_agent.topics import DEFAULT_TOPICS
from load_tests import bench_storage
from tests.support.data import data_set


def test_a_real_log_as_the_store_keeps_it(tmp_path: Path) -> None:
    messages = list(bench_storage.intel_messages(data_set("robots/intel.clf.bz2"), most_s=20.0))
    topics = [message.topic for message in messages]
    assert set(topics) == {"/intel/scan", "/intel/odom", "/intel/tf"}
    for name in ("all", "part"):
        (tmp_path / name).mkdir()
    every = bench_storage.measure(messages, tmp_path / "all", bench_storage.EVERYTHING)
    assert (every.messages, every.rows) == (len(messages), 0)
    assert every.objects < sum(len(message.payload) for message in messages)
    part = bench_storage.measure(messages, tmp_path / "part", DEFAULT_TOPICS)
    assert 0 < part.messages < topics.count("/intel/scan") + topics.count("/intel/odom")
    assert part.rows > 0
    assert part.database + part.objects < every.database + every.objects


@pytest.mark.integration
def test_both_robots_are_reported(capsys: pytest.CaptureFixture[str]) -> None:
    intel = str(data_set("robots/intel.clf.bz2"))
    assert bench_storage.main(["--quick", "--intel", intel]) == 0
    told = capsys.readouterr().out
    for words in ("sim: ", "intel: ", "raw CDR", "rosbags MCAP, zstd", "store, as by default", "store, every message"):
        assert words in told
    assert bench_storage.main(["--intel", "nowhere"]) == 2
