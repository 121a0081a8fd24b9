"""The state machine of a condition, ok -> pending -> firing -> clearing -> ok, for many conditions at once.

A condition fires when it was breached for so long, and is over when it was inside for so long. Only time in which it
was looked at counts, a minute at most between two looks, so that neither a gap of years nor a clock set back opens
or clears anything.
"""

from __future__ import annotations

import numpy as np

from gateway.alerting.anomaly.detectors.columns import Bools, Columns, Floats, Ints

__all__ = ["CLEARING", "FIRING", "OK", "PENDING", "ConditionStates"]

OK, PENDING, FIRING, CLEARING = range(4)
LONGEST_STEP_S = 60.0


class ConditionStates:
    """The states of many conditions, a row each."""

    def __init__(self) -> None:
        self.columns = Columns(
            state=np.int8(OK), held_s=np.float64(0), seen_s=np.float64(np.nan), since_s=np.float64(np.nan)
        )

    def step(
        self, rows: Ints, breached: Bools, inside: Bools, now_s: float | Floats, *, for_s: Floats, clear_s: Floats
    ) -> tuple[Bools, Bools]:
        """What opened and what cleared, as masks over `rows`; between breached and inside the state stays."""
        columns = self.columns
        state, held = columns["state"][rows], columns["held_s"][rows]
        passed = np.minimum(np.fmax(now_s - columns["seen_s"][rows], 0.0), LONGEST_STEP_S)  # never seen, NaN, is 0
        columns["seen_s"][rows] = now_s
        starting = (state == OK) & breached
        columns["since_s"][rows] = np.where(starting, now_s, columns["since_s"][rows])
        turned = starting | ((state == FIRING) & inside)
        state = np.where(turned, state + 1, state)
        back = ((state == PENDING) & ~breached) | ((state == CLEARING) & ~inside)
        state = np.where(back, state - 1, state)
        held = np.where(turned | back, 0.0, held + passed)
        opened = (state == PENDING) & (held >= for_s)
        cleared = (state == CLEARING) & (held >= clear_s)
        state = np.where(opened, FIRING, np.where(cleared, OK, state))
        columns["state"][rows], columns["held_s"][rows] = state, held
        return opened, cleared

    def firing(self, rows: Ints) -> Bools:
        """Which are firing or clearing."""
        found: Bools = self.columns["state"][rows] >= FIRING
        return found

    def since_s(self, row: int) -> float:
        """When a condition's breach began."""
        return float(self.columns["since_s"][row])
