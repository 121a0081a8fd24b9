"""A sample of `make campaign ARGS=partitions`: real networks that fail, in namespaces of their own."""

from __future__ import annotations

import re

import pytest

from load_tests.campaigns.partitions import KINDS
from tests.faults.campaigns import run_campaign, skip_without_namespaces


@pytest.mark.integration
@pytest.mark.timeout(300)
def test_two_cycles_of_each_kind_of_partition_lose_nothing() -> None:
    skip_without_namespaces()

    output = run_campaign("partitions", "--cycles", "2", "--together")

    assert re.search(rf"together +{2 * len(KINDS)} ", output), output
    assert "PASS" in output
