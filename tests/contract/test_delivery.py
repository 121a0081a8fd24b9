"""The delivery contract: thousands of simulated worlds in which everything fails, and nothing is lost unsaid.

A failing seed is named in the message; `python -m load_tests.campaign_sim --seeds N` runs it again.
"""

from __future__ import annotations

import pytest

from load_tests.campaign_sim import run
from tests.support.link_sim import KINDS

BLOCKS, WORLDS = 20, 250
EACH_KIND = 40


def assert_no_failures(failures: list[tuple[int, str]], options: str = "") -> None:
    """Name the seeds and how to run them again."""
    seeds = " ".join(str(seed) for seed, _ in failures)
    assert not failures, f"{failures[:3]}; again: python -m load_tests.campaign_sim{options} --seeds {seeds}"


@pytest.mark.parametrize("block", range(BLOCKS))
def test_accepted_is_stored_once_or_declared_lost(block: int) -> None:
    assert_no_failures(run(range(block * WORLDS, (block + 1) * WORLDS)))


@pytest.mark.parametrize("kind", KINDS)
def test_every_kind_of_mishap_alone(kind: str) -> None:
    """A disk that was cloned, restored, wiped or that rots; a store put back to a backup."""
    assert_no_failures(run(range(EACH_KIND), kinds=(kind,)), f" --kind {kind}")


def test_all_mishaps_together() -> None:
    options = "".join(f" --kind {kind}" for kind in KINDS)
    assert_no_failures(run(range(EACH_KIND), kinds=tuple(KINDS)), options)
