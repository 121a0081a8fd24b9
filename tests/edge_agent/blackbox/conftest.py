"""Rings that are closed at the end of their test."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import Any

import pytest

from tests.edge_agent.blackbox.rig import RingRig


@pytest.fixture
def make_rig() -> Iterator[Callable[..., RingRig]]:
    """Makes RingRigs."""
    made: list[RingRig] = []

    def make(*arguments: Any, **options: Any) -> RingRig:
        made.append(RingRig(*arguments, **options))
        return made[-1]

    yield make
    for rig in made:
        rig.ring.close_file()
