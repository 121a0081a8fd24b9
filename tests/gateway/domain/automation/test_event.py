"""Which events a filter's patterns mean."""

from __future__ import annotations

import random  # noqa: TID251 - seeded
from fnmatch import _compile_pattern, fnmatchcase  # type: ignore[attr-defined]

from gateway.domain.automation.event import Event, EventFilter, like


def test_a_pattern_means_what_a_shell_means_by_it() -> None:
    rng = random.Random(1)
    for _ in range(5000):
        text = "".join(rng.choices("ab.", k=rng.randrange(8)))
        pattern = "".join(rng.choices("ab.*?", k=rng.randrange(8)))
        assert like(text, pattern) == fnmatchcase(text, pattern), (text, pattern)


def test_patterns_of_clients_are_compiled_and_kept_nowhere() -> None:
    """A viewer chooses sixty-four of them with every request, as long as they may be."""
    before = _compile_pattern.cache_info().misses
    event = Event(seq=1, kind="robot.online", robot="r", at_ns=1, gateway="g")
    wanted = EventFilter(kinds=tuple(f"{'a*' * 120}{number}" for number in range(64)))
    assert not wanted.matches(event)
    assert _compile_pattern.cache_info().misses == before
