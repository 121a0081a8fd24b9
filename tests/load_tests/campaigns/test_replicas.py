"""What the campaign of replicas calls good."""

from __future__ import annotations

import pytest

from load_tests.campaigns.replicas import Figures


def test_what_nothing_went_wrong_with_is_good() -> None:
    assert Figures(kills=30, samples=100, schedules=30, links_s=[0.2, 4.9]).good


@pytest.mark.parametrize(
    "wrong", [{"lost": 1}, {"twice": 1}, {"misfired": 1}, {"repeated": 1}, {"links_s": [0.2, 5.1]}]
)
def test_whatever_goes_wrong_is_not_good(wrong: dict[str, object]) -> None:
    assert not Figures(kills=30, samples=100, schedules=30, **wrong).good  # type: ignore[arg-type]
