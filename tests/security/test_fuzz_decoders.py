"""Every decoder takes every damage of what it knows: nothing but its documented errors, and bounded memory.

A hang would be ended by the suite's own timeout; nothing here is timed.
"""

from __future__ import annotations

import random  # noqa: TID251 - seeded
import tracemalloc
from collections.abc import Iterable, Iterator

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from tests.security.fuzz.mutate import mutated, sweep
from tests.security.fuzz.target import Target
from tests.security.targets import TARGETS

EXAMPLES = 300
MANY = 3000
SWEPT = 160
UNDERSTOOD_BY_NOBODY = {  # of these no seed is taken as it is: what is right there needs a secret that tests lack
    "certificate",
    "roots that are shown",
}


@pytest.fixture
def memory() -> Iterator[None]:
    """What Python and numpy take is counted."""
    tracemalloc.start()
    yield
    tracemalloc.stop()


def drive(target: Target, inputs: Iterable[bytes]) -> None:
    """Run them all; whatever is not documented fails here, and so does a length that was believed."""
    for data in inputs:
        before = tracemalloc.get_traced_memory()[0]
        tracemalloc.reset_peak()
        target(data)
        taken = tracemalloc.get_traced_memory()[1] - before
        bound = target.base_bytes + target.per_byte * len(data)
        assert taken <= bound, f"{target.name}: {taken} bytes for an input of {len(data)}: {data[:200]!r}"


@pytest.mark.parametrize("name", TARGETS)
def test_a_seed_is_understood(name: str) -> None:
    target = TARGETS[name]
    assert name in UNDERSTOOD_BY_NOBODY or any(target(seed) for seed in target.seeds)


@pytest.mark.usefixtures("memory")
@pytest.mark.parametrize("name", TARGETS)
def test_every_cut_and_every_inflated_length(name: str) -> None:
    target = TARGETS[name]
    for seed in target.seeds:
        drive(target, sweep(seed, SWEPT // target.cost))


@pytest.mark.usefixtures("memory")
@pytest.mark.parametrize("name", TARGETS)
def test_damage_of_every_kind(name: str) -> None:
    target, rng = TARGETS[name], random.Random(name)
    drive(target, (mutated(target.seeds, rng) for _ in range(max(30, EXAMPLES // target.cost))))


@pytest.mark.parametrize("name", TARGETS)
def test_any_bytes(name: str) -> None:
    target = TARGETS[name]

    @settings(
        max_examples=max(10, 100 // target.cost), deadline=None, database=None, suppress_health_check=list(HealthCheck)
    )
    @given(data=st.one_of(st.binary(max_size=300), st.sampled_from(target.seeds).flatmap(damaged)))
    def check(data: bytes) -> None:
        target(data)

    check()


def damaged(seed: bytes) -> st.SearchStrategy[bytes]:
    """A seed with any bytes in the place of some of its own."""
    places = st.tuples(st.integers(0, len(seed)), st.integers(0, 16), st.binary(max_size=32))
    return places.map(lambda place: seed[: place[0]] + place[2] + seed[place[0] + place[1] :])


@pytest.mark.integration
@pytest.mark.usefixtures("memory")
@pytest.mark.parametrize("name", TARGETS)
def test_much_damage(name: str) -> None:
    target, rng = TARGETS[name], random.Random(f"much {name}")
    drive(target, (mutated(target.seeds, rng) for _ in range(max(100, MANY // target.cost))))
