"""The benchmark of what judging costs, with few series and without river: that it measures and prints."""

from __future__ import annotations

import pytest

from load_tests.anomaly import speed
from load_tests.peers.venvs import HomeFailed


def test_a_table_without_river(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> None:
    def fail(name: str) -> str:
        raise HomeFailed(f"{name} is not installed")

    monkeypatch.setattr(speed, "python_of", fail)
    monkeypatch.setattr(speed, "WARM_STEPS", 5)
    assert speed.main(["--series", "80", "--rounds", "2", "--ticks", "2", "--warm-s", "2"]) == 0
    reported = capsys.readouterr().out
    assert "river is not installed" in reported
    assert "80 series" in reported
    assert "everything (Judge)" in reported
