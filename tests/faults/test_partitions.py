"""A sample of `make campaign ARGS=partitions`: real networks that fail, in namespaces of their own."""

from __future__ import annotations

import pytest

from load_tests.campaign_partitions import KINDS
from tests.faults.campaigns import run_campaign, skip_without_namespaces


@pytest.mark.integration
@pytest.mark.timeout(300)
def test_some_cycles_of_each_kind_of_partition_lose_nothing() -> None:
    skip_without_namespaces()

    output = run_campaign("partitions", "--cycles", "4", "--parallel", "6", timeout_s=280)

    assert all(kind in output for kind in KINDS)
    assert "PASS" in output
