"""A sample of `make campaign ARGS=kills`: robot and gateway die and stop under load, and nothing is lost."""

from __future__ import annotations

import pytest

from tests.faults.campaigns import run_campaign


@pytest.mark.integration
def test_ten_kills_lose_nothing_store_nothing_twice_and_change_nothing() -> None:
    output = run_campaign("kills", "--cycles", "10", "--leg", "10", "--tick-ms", "10")

    assert "PASS: 0 lost, 0 duplicate, 0 wrong" in output
