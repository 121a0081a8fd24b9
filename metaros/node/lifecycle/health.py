"""Health rules evaluated over time: readings and `now` in, explained decisions out. Pure.

Nothing flaps, by four means: a signal must be bad without a break for `for_s` and good for `clear_for_s`; between bad
and good lies a band that is neither; every relapse doubles the time that the signal must be good; and after a change of
state nothing is judged for `grace_s`. A time without readings is no evidence: a step counts for one second at most.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from enum import Enum
from typing import Final

from metaros.errors import UsageError
from metaros.node.lifecycle.health_rules import Action, Decision, HealthRule, Step

__all__ = ["Health", "Mode", "RuleState"]

_STEP_MAX_S: Final = 1.0
_BRING_UP_S: Final = 5.0  # after a transition that health wanted and that failed; doubled each time
_BRING_UP_MAX_S: Final = 60.0


class Mode(Enum):
    """The sum of all rules."""

    HEALTHY = "healthy"
    DEGRADED = "degraded"
    DOWN = "down"  # health keeps the node from being active


class RuleState:
    """One rule and what it has seen."""

    def __init__(self, rule: HealthRule) -> None:
        self.rule = rule
        self.value: float | None = None
        self.tripped = False
        self.since_s = -math.inf  # of the last trip or clearance
        self.relapses = 0
        self.attempts = 0
        self.next_try_s = -math.inf
        self._bad_s: float | None = None  # for how long without a break; None when not bad now
        self._good_s: float | None = None

    def forget_evidence(self) -> None:
        """Begin to look anew; what was decided stays."""
        self._bad_s = self._good_s = None

    def evaluate(self, now_s: float, dt_s: float, value: float | None) -> bool:
        """Take in a reading; True when the rule tripped or cleared by it."""
        self.value = value
        signal, rule = self.rule.signal, self.rule
        bad, good = value is not None and signal.bad(value), value is not None and signal.good(value)
        self._bad_s = (0.0 if self._bad_s is None else self._bad_s + dt_s) if bad else None
        self._good_s = (0.0 if self._good_s is None else self._good_s + dt_s) if good else None
        if not self.tripped and self._bad_s is not None and self._bad_s >= rule.for_s:
            self.relapses = self.relapses + 1 if now_s - self.since_s < rule.forget_s else 0
            self.tripped, self.attempts, self.next_try_s = True, 0, now_s
        elif self.tripped and self._good_s is not None and self._good_s >= rule.clear_after_s(self.relapses):
            self.tripped = False
        else:
            return False
        self.since_s = now_s
        self.forget_evidence()
        return True

    def holds(self) -> bool:
        """Whether the rule wants the node not to be active."""
        action, rule = self.rule.action, self.rule
        if action is Action.DEGRADE or not self.tripped:
            return False
        return action is Action.DEACTIVATE or self.attempts > rule.tries

    def describe(self) -> str:
        """The present reading as a clause."""
        return "not measured" if self.value is None else self.rule.signal.describe(self.value)


class Health:
    """All rules of a node. `step` is called several times a second; `carried_out` after each decision but degrading."""

    def __init__(self, rules: Sequence[HealthRule], *, now_s: float, grace_s: float = 2.0) -> None:
        names = [rule.name for rule in rules]
        if len(set(names)) != len(names):
            raise UsageError(f"health rules must have names of their own: {', '.join(names)}")
        self.rules = [RuleState(rule) for rule in rules]
        self.down = False
        self._grace_s = grace_s
        self._last_s = now_s
        self._quiet_until_s = now_s + grace_s
        self._failures = 0
        self._again_s = -math.inf

    @property
    def mode(self) -> Mode:
        """Healthy, degraded, or kept from being active."""
        if self.down:
            return Mode.DOWN
        return Mode.DEGRADED if self._degrading() else Mode.HEALTHY

    def reset(self, now_s: float) -> None:
        """Somebody else changed the node's state: evaluate everything anew."""
        self.rules = [RuleState(state.rule) for state in self.rules]
        self.down = False
        self._failures, self._again_s = 0, -math.inf
        self._last_s, self._quiet_until_s = now_s, now_s + self._grace_s

    def step(self, now_s: float, readings: Mapping[str, float | None], *, active: bool) -> list[Decision]:
        """Evaluate the readings; what has to be done now, in this order."""
        dt_s, self._last_s = min(now_s - self._last_s, _STEP_MAX_S), now_s
        if not active and not self.down:
            return []
        decisions: list[Decision] = []
        if now_s >= self._quiet_until_s:
            for state in self.rules:
                before_s = state.since_s
                if state.evaluate(now_s, dt_s, readings.get(state.rule.signal.key)):
                    decisions += self._changed(state, now_s, before_s)
        return decisions + self._moves(now_s)

    def carried_out(self, now_s: float, decision: Decision, *, active: bool) -> None:
        """A decision that moves the node was tried; `active` says where it led."""
        failed = active is (decision.step is Step.DEACTIVATE)
        self.down = not active
        self._failures = self._failures + 1 if failed else 0
        wait_s = min(_BRING_UP_S * 2.0 ** min(self._failures - 1, 16), _BRING_UP_MAX_S)
        self._again_s = now_s + wait_s if failed else -math.inf
        if active:
            self._quiet_until_s = now_s + self._grace_s
            for state in self.rules:
                state.forget_evidence()

    def _degrading(self) -> list[RuleState]:
        return [state for state in self.rules if state.tripped and state.rule.action is Action.DEGRADE]

    def _changed(self, state: RuleState, now_s: float, before_s: float) -> list[Decision]:
        """A degrading rule decides at once; the others by what they hold."""
        if state.rule.action is not Action.DEGRADE:
            return []
        if state.tripped:
            facts = {"for_s": f"{state.rule.for_s:g}", "relapses": str(state.relapses)}
            return [_decide(Step.DEGRADE, state, _for(state), **facts)]
        if self._degrading():
            return []
        good_s, lasted_s = state.rule.clear_after_s(state.relapses), now_s - before_s
        reason = f"{state.describe()} for {good_s:g} s; it lasted {lasted_s:.1f} s"
        return [_decide(Step.RESTORE, state, reason, clear_for_s=f"{good_s:g}", lasted_s=f"{lasted_s:.1f}")]

    def _moves(self, now_s: float) -> list[Decision]:
        """At most one decision that moves the node."""
        if now_s < self._again_s:
            return []
        holding = [state for state in self.rules if state.holds()]
        if self.down:
            return [] if holding else [self._reactivation()]
        if holding:
            return [self._deactivation(holding[0])]
        cycling = [
            state
            for state in self.rules
            if state.tripped and state.rule.action in (Action.RECOVER, Action.RESTART) and now_s >= state.next_try_s
        ]
        cycling.sort(key=lambda state: state.rule.action is not Action.RESTART)
        return [self._attempt(cycling[0], now_s)] if cycling else []

    def _deactivation(self, state: RuleState) -> Decision:
        tries = state.rule.tries
        after = "" if state.rule.action is Action.DEACTIVATE else f", and {tries} attempts did not help"
        return _decide(Step.DEACTIVATE, state, f"{_for(state)}{after}")

    def _reactivation(self) -> Decision:
        latest = max(self.rules, key=lambda state: state.since_s)
        again = f", attempt {self._failures + 1}" if self._failures else ""
        return _decide(Step.REACTIVATE, latest, f"{latest.describe()}{again}", attempt=str(self._failures + 1))

    def _attempt(self, state: RuleState, now_s: float) -> Decision:
        """One more cycle, or, when all were in vain, none: then the rule holds the node down."""
        state.attempts += 1
        if state.attempts > state.rule.tries:
            return self._deactivation(state)
        wait_s = state.rule.retry_after_s(state.attempts)
        state.next_try_s = now_s + wait_s
        step = Step.RESTART if state.rule.action is Action.RESTART else Step.RECOVER
        reason = f"{state.describe()}; attempt {state.attempts} of {state.rule.tries}, the next in {wait_s:g} s"
        return _decide(step, state, reason, attempt=str(state.attempts), retry_s=f"{wait_s:g}")


def _for(state: RuleState) -> str:
    """The reading, and for how long it was like that."""
    return f"{state.describe()} for {state.rule.for_s:g} s" if state.rule.for_s else state.describe()


def _decide(step: Step, state: RuleState, reason: str, **facts: str) -> Decision:
    value = "" if state.value is None else f"{state.value:.6g}"
    return Decision(step, state.rule.name, reason, {"signal": state.rule.signal.key, "value": value, **facts})
