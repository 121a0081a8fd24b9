"""The delivery contract: hundreds of simulated worlds in which everything fails, and nothing is lost unsaid.

They are so many that each broken rule of `test_delivery_mutations.py` is found by them, too. Tens of thousands:
`make campaign ARGS=simulator`. A failing seed is named in the message, and runs again by
`python -m load_tests.campaigns.delivery_simulation --seeds N`.
"""

from __future__ import annotations

import pytest

from load_tests.campaigns.delivery_simulation import run
from tests.support.simulation.link_sim import KINDS

BLOCKS, WORLDS = 6, 50
MISHAPS: dict[str, tuple[tuple[str, ...], range]] = {
    **{kind: ((kind,), range(12)) for kind in KINDS},
    "clone and restore": (("clone", "restore"), range(100, 124)),
    "all": (tuple(KINDS), range(20)),
}


def assert_no_failures(failures: list[tuple[int, str]], options: str = "") -> None:
    """Name the seeds and how to run them again."""
    seeds = " ".join(str(seed) for seed, _ in failures)
    assert not failures, (
        f"{failures[:3]}; again: python -m load_tests.campaigns.delivery_simulation{options} --seeds {seeds}"
    )


# The first block at a desk, all in CI.
@pytest.mark.parametrize("block", [0, *(pytest.param(n, marks=pytest.mark.integration) for n in range(1, BLOCKS))])
def test_accepted_is_stored_once_or_declared_lost(block: int) -> None:
    assert_no_failures(run(range(block * WORLDS, (block + 1) * WORLDS)))


@pytest.mark.parametrize("mishap", MISHAPS)
def test_mishaps_of_certain_kinds(mishap: str) -> None:
    """A disk that was cloned, restored, wiped or that rots; a store put back to a backup: each alone, some, and all."""
    kinds, seeds = MISHAPS[mishap]
    assert_no_failures(run(seeds, kinds=kinds), "".join(f" --kind {kind}" for kind in kinds))
