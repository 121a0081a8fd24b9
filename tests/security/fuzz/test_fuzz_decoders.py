"""Every decoder takes every damage of what it knows: nothing but its documented errors, and bounded memory.

A hang would be ended by the suite's own timeout; nothing here is timed.
"""

from __future__ import annotations

import random  # noqa: TID251 - seeded
import tracemalloc
from collections.abc import Iterable

import pytest

from tests.security.fuzz.mutate import mutated, sweep
from tests.security.fuzz.target import Target
from tests.security.fuzz.targets import TARGETS

EXAMPLES = 160  # each of the nine kinds of damage more than once; by the minute: make campaign ARGS=fuzz
SWEPT = 128
WEIGHED = 4  # of so many inputs one is weighed, which makes it three times as slow: of a sweep those of huge lengths
UNDERSTOOD_BY_NOBODY = {  # of these no seed is taken as it is: what is right there needs a secret that tests lack
    "certificate",
    "roots that are shown",
}


def drive(target: Target, inputs: Iterable[bytes]) -> None:
    """Run them all; whatever is not documented fails here, and so does a length that was believed."""
    for number, data in enumerate(inputs):
        if number % WEIGHED:
            target(data)
            continue
        tracemalloc.start()
        try:
            target(data)
            taken = tracemalloc.get_traced_memory()[1]
        finally:
            tracemalloc.stop()
        bound = target.base_bytes + target.per_byte * len(data)
        assert taken <= bound, f"{target.name}: {taken} bytes for an input of {len(data)}: {data[:200]!r}"


def test_a_seed_is_understood() -> None:
    understood = {name for name, target in TARGETS.items() if any(target(seed) for seed in target.seeds)}
    assert set(TARGETS) - understood <= UNDERSTOOD_BY_NOBODY


@pytest.mark.integration
@pytest.mark.parametrize("name", TARGETS)
def test_cuts_inflated_lengths_and_damage_of_every_kind(name: str) -> None:
    target, rng = TARGETS[name], random.Random(name)
    for seed in target.seeds:
        drive(target, sweep(seed, SWEPT // target.cost))
    drive(target, (mutated(target.seeds, rng) for _ in range(max(30, EXAMPLES // target.cost))))
    drive(target, (rng.randbytes(rng.randrange(300)) for _ in range(max(10, 60 // target.cost))))
