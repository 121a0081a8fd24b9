"""The benchmark of storage with a few seconds of two robots: that everything is counted."""

from __future__ import annotations

from pathlib import Path

import pytest

from edge_agent.config.topic_table import DEFAULT_TOPICS
from load_tests.benchmarks.gateway import storage
from tests.support.data import data_set


def test_a_real_log_as_the_store_keeps_it(tmp_path: Path) -> None:
    messages = list(storage.intel_messages(data_set("robots/intel.clf.bz2"), most_s=20.0))
    topics = [message.topic for message in messages]
    assert set(topics) == {"/intel/scan", "/intel/odom", "/intel/tf"}
    for name in ("all", "part"):
        (tmp_path / name).mkdir()
    every = storage.measure(messages, tmp_path / "all", storage.EVERYTHING)
    assert (every.messages, every.rows) == (len(messages), 0)
    assert every.objects < sum(len(message.payload) for message in messages)
    part = storage.measure(messages, tmp_path / "part", DEFAULT_TOPICS)
    assert 0 < part.messages < topics.count("/intel/scan") + topics.count("/intel/odom")
    assert part.rows > 0
    assert part.database + part.objects < every.database + every.objects


@pytest.mark.integration
def test_both_robots_are_reported(capsys: pytest.CaptureFixture[str]) -> None:
    intel = str(data_set("robots/intel.clf.bz2"))
    assert storage.main(["--quick", "--intel", intel]) == 0
    reported = capsys.readouterr().out
    for words in ("sim: ", "intel: ", "raw CDR", "rosbags MCAP, zstd", "store, as by default", "store, every message"):
        assert words in reported
    assert storage.main(["--intel", "nowhere"]) == 2
