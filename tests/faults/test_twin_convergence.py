"""Whatever people edit at once, however links break and whoever is killed: every robot ends at what is desired.

Both ends are the real ones (`tests.support.robots.twin_testbed`); what is to be is worked out by a model.
"""

from __future__ import annotations

import asyncio
import random  # noqa: TID251 - seeded
import shutil
import tempfile
from pathlib import Path
from typing import Any

import pytest
from hypothesis import HealthCheck, Phase, settings
from hypothesis import strategies as st
from hypothesis.stateful import RuleBasedStateMachine, initialize, invariant, rule

from tests.support.processes.fast_loop import SPEED, HurriedLoop
from tests.support.robots.twin_edits import Edits

SEEDS = st.integers(0, 2**32 - 1)


class Editing(RuleBasedStateMachine):
    """Bursts of edits, and in the middle of them everything that can go wrong."""

    least_edits = 0

    def __init__(self) -> None:
        super().__init__()
        self.folder = Path(tempfile.mkdtemp())
        self.loop = HurriedLoop()

    def do(self, work: Any) -> None:
        self.loop.run_until_complete(asyncio.wait_for(work, 120 * SPEED))

    @initialize(seed=SEEDS)
    def begin(self, seed: int) -> None:
        self.edits = Edits(self.folder, random.Random(seed))
        self.do(self.edits.world.begin())
        self.do(self.edits.burst(15, 2))

    @rule(edits=st.integers(10, 60), faults=st.integers(0, 8))
    def burst(self, edits: int, faults: int) -> None:
        """Many people at once, over links that break."""
        self.do(self.edits.burst(edits, faults))

    @rule(seconds=st.sampled_from([0.5, 5.0, 70.0]))
    def time(self, seconds: float) -> None:
        """Windows end."""
        self.do(asyncio.sleep(seconds))

    @rule()
    def gateway_restarts(self) -> None:
        """Every link goes, and what the gateway had in memory."""
        self.do(self.edits.world.restart_gateway())

    @invariant()
    def promises(self) -> None:
        """See `World.check`."""
        self.edits.world.check()

    def teardown(self) -> None:
        try:
            while self.edits.model.edits < self.least_edits:
                self.do(self.edits.burst(50, 6))
            self.do(self.edits.converge())
            self.edits.world.check()
        finally:
            self.do(self.edits.world.end())
            self.loop.close()
            shutil.rmtree(self.folder, ignore_errors=True)


class HundredsOfEdits(Editing):
    """The same until hundreds of edits were made in one world; `make campaign ARGS=twin` has a hundred such worlds."""

    least_edits = 300


COMMON = settings(
    deadline=None,
    suppress_health_check=list(HealthCheck),
    phases=[Phase.explicit, Phase.reuse, Phase.generate],  # what does not converge takes minutes to say so
)
TestEditing = Editing.TestCase
TestEditing.settings = settings(COMMON, max_examples=3, stateful_step_count=4)
HundredsOfEdits.TestCase.settings = settings(COMMON, max_examples=1, stateful_step_count=10)
TestHundredsOfEdits = pytest.mark.integration(pytest.mark.timeout(900)(HundredsOfEdits.TestCase))
