"""`make campaign ARGS=disks`: full disks on either side lose no event and do not cut the link."""

from __future__ import annotations

import pytest

from tests.faults.campaigns import run_campaign, skip_without_namespaces


@pytest.mark.integration
@pytest.mark.timeout(200)
def test_full_disks_on_each_side_lose_nothing() -> None:
    skip_without_namespaces()

    output = run_campaign("disks", "--cycles", "2", "--together")

    assert "PASS" in output
