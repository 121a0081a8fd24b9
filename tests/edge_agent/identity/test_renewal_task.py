"""When the task that renews asks: by its rule, and not because a wait is over."""

from __future__ import annotations

import random  # noqa: TID251 - seeded
from pathlib import Path
from typing import Any

from edge_agent.identity.credentials import Credentials
from edge_agent.identity.renewal_task import RenewalTask
from metaros.clock import ManualClock
from tests.edge_agent.identity.test_credentials import identity_at


class Rule:
    """Fresh for so many looks, and then due. Every wait is over at once."""

    def __init__(self, fresh: int) -> None:
        self.looks = 0
        self._fresh = fresh

    @property
    def state(self) -> str:
        return "fresh" if self.looks <= self._fresh else "due"

    def wait_s(self) -> float:
        self.looks += 1
        return 0.0

    def may_ask(self) -> bool:
        return True


async def test_the_end_of_a_wait_is_another_look_and_no_renewal(tmp_path: Path) -> None:
    renewing = RenewalTask(Credentials(identity_at("https://fleet")), tmp_path, ManualClock(), random.Random(1))
    rule: Any = Rule(fresh=3)
    renewing.rule = rule
    await renewing._due()
    assert rule.looks == 4
