"""What the benchmark's processes are told to publish, and when: one line of JSON each, answered by how many it were."""

from __future__ import annotations

import json
import sys
import time
from collections.abc import Iterator
from dataclasses import dataclass

__all__ = ["SETTLE_S", "STEP_S", "TOPIC", "Load", "due_of", "read_load"]

TOPIC = "/bench"
STEP_S = 0.001
SETTLE_S = 0.3


@dataclass(frozen=True, slots=True)
class Load:
    """Messages of `size` bytes, `rate` a second, for `seconds`."""

    seconds: float
    rate: float
    size: int


def due_of(load: Load) -> Iterator[int]:
    """How many messages are due, each time it is asked; it ends with the load."""
    began_s, sent = time.monotonic(), 0
    while (passed_s := time.monotonic() - began_s) < load.seconds:
        due = int(passed_s * load.rate) + 1 - sent
        sent += due
        yield due


def read_load() -> Load | None:
    """The next line of the input; None when nobody asks any more."""
    line = sys.stdin.readline()
    return Load(**json.loads(line)) if line else None
