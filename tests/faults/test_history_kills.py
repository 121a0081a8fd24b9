"""A sample of `make campaign ARGS=history`: a gateway dies while it compacts, purges and exports; nothing is lost."""

from __future__ import annotations

import pytest

from tests.faults.campaigns import run_campaign


@pytest.mark.integration
def test_eight_kills_lose_nothing_store_nothing_twice_and_leave_no_object() -> None:
    output = run_campaign("history", "--cycles", "8", "--leg", "4", "--tick-ms", "10")

    assert "PASS: 0 lost, 0 duplicate, 0 wrong" in output
