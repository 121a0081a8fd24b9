"""The recorder's benchmark with tiny rounds: that it measures, not what."""

from __future__ import annotations

from pathlib import Path

import pytest

from load_tests.benchmarks.library import record


def test_every_writer_writes(tmp_path: Path) -> None:
    rates = record.writers(tmp_path, rounds=1, scale=0.001)
    assert len(rates) == len(record.SIZES) * len(record.WRITERS)
    assert all(figure > 0 for figures in rates.values() for figure in figures)
    assert list(tmp_path.iterdir()) == []


@pytest.mark.integration
def test_a_recording_from_the_wire(tmp_path: Path) -> None:
    found = record.record(tmp_path, 1000, 200.0, 1.0)
    assert found["rate"] > 0
    assert found["missing"] >= 0
