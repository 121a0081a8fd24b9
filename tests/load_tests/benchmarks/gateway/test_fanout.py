"""The fan-out benchmark in its shortest form: that it measures, not what."""

from __future__ import annotations

import pytest

from load_tests.benchmarks.gateway import fanout
from load_tests.fanout.from_robot import KINDS

QUICK = ["--quick", "--no-pin"]


@pytest.mark.integration
def test_a_robots_samples_reach_both_authenticators(capsys: pytest.CaptureFixture[str]) -> None:
    assert fanout.main([*QUICK, "--json", "--seconds", "0.2"]) == 0
    rows = _rows(capsys.readouterr().out)
    for name in KINDS:
        measured, compared = (row for row in rows if row[0] == f"gateway, 5 ms, {name}")
        assert measured[3] == "elsewhere", "the load is made in another process"
        assert float(measured[5]) > 0, "CPU of a delivery"
        assert float(measured[8].removesuffix(" %")) > 0, "what was delivered"
        assert all(float(cell) > 0 for cell in compared[1:]), "raw and calibrated"


@pytest.mark.integration
def test_rounds_beside_one_that_never_reads(capsys: pytest.CaptureFixture[str]) -> None:
    fanout.main([*QUICK, "--stall", "--seconds", "0.5"])  # too short a time for it to be cut
    reported = capsys.readouterr().out
    figures = {row[0]: row[1:] for row in _rows(reported)}
    for name in ("alone", "beside one that never reads"):
        assert float(figures[name][1]) >= float(figures[name][0]) > 0, "p99 and p50 of all rounds"
    assert "noise: unknown" in reported


def _rows(text: str) -> list[list[str]]:
    return [[cell.strip() for cell in line.strip("|").split("|")] for line in text.splitlines() if line.startswith("|")]
