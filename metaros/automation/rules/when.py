"""When a rule acts: conditions with a memory, one state a group of events, time passed in.

An event goes through what a rule names of these, in this order:

    hysteresis ▶ for ▶ edge ▶ rate ▶ debounce ▶ cooldown ▶ act
    level        held   pulse  pulse  pulse      pulse

`hysteresis` makes a level of a value (without it the level is whether the event matches), `for` a level that has
lasted, `edge` a pulse of a level's beginning or end (without it every matching event is one), and the last three take
pulses away. `absent_for` stands alone before `cooldown`: its pulse is that no matching event came for so long.

Time is the caller's, of one clock for events and timers. One that steps back by up to `SLACK_NS` is taken to stand
still; one that steps back by more takes all stamps with it, so that what waits waits as long as it still had to. One
that jumps ahead makes due what waits: once, as any late timer does.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, fields, replace
from typing import Any, Self

from metaros.automation.rules.fields import field_at, group_of_fields
from metaros.automation.rules.numeric import is_number
from metaros.automation.rules.when_text import When

__all__ = ["SLACK_NS", "State", "Step", "When", "at_rest", "due", "group_of", "step", "value_of"]

SLACK_NS = 60_000_000_000


@dataclass(frozen=True, slots=True, kw_only=True)
class State:
    """What a rule remembers of one group; fresh without arguments. Stamps are ns, None for never."""

    level: bool = False  # whether the condition held last
    since_ns: int | None = None  # since when; with absent_for, the last event
    held: bool = False  # whether it has lasted; with absent_for, whether it was found absent
    pulses_ns: tuple[int, ...] = ()  # that rate counts, the oldest first; fewer than its count
    burst_ns: int | None = None  # the last pulse of a burst that debounce waits for the end of
    fired_ns: int | None = None  # for cooldown
    seen_ns: int | None = None  # the clock, last time

    def to_json(self) -> dict[str, Any]:
        """What differs from a fresh one."""
        found = {
            each.name: getattr(self, each.name) for each in fields(self) if getattr(self, each.name) != each.default
        }
        return {name: list(value) if type(value) is tuple else value for name, value in found.items()}

    @classmethod
    def from_json(cls, document: Mapping[str, Any]) -> Self:
        """What `to_json` gave; keys of other versions are ignored."""
        known = {each.name: document[each.name] for each in fields(cls) if each.name in document}
        return cls(**known | {"pulses_ns": tuple(known.get("pulses_ns", ()))})


@dataclass(frozen=True, slots=True)
class Step:
    """What came of an event or a timer: the state to keep, whether to act, when to call `due`.

    `ended`: what had held, or been absent, does so no more.
    """

    state: State
    fired: bool
    due_ns: int | None
    ended: bool


def step(when: When, state: State, matched: bool, value: float | None, now_ns: int) -> Step:
    """An event of this group came; `matched` says whether it is one that the rule is about.

    What does not match is handed in as well where a level has an end. `value` is what `hysteresis` looks at. A timer
    that is overdue goes first; where both act, that is one `fired`.
    """
    turn = _Evaluation(when, state, now_ns)
    turn.elapse()
    turn.observe(matched, value)
    return turn.result()


def due(when: When, state: State, now_ns: int) -> Step:
    """The time of `due_ns` has come. A fresh state with `absent_for` begins to wait."""
    turn = _Evaluation(when, state, now_ns)
    if when.absent_for_ns is not None and turn.since_ns is None:
        turn.since_ns = turn.now_ns
    turn.elapse()
    return turn.result()


def at_rest(when: When, state: State, now_ns: int) -> bool:
    """Whether a fresh state would do as well, so that this one need not be kept.

    For a rule without `edge`, all that is lost then is that an end of its level be told.
    """
    turn = _Evaluation(when, state, now_ns)
    turn.elapse()
    cooling = when.cooldown_ns is not None and turn.fired_ns is not None and turn.age(turn.fired_ns) < when.cooldown_ns
    counting = when.rate is not None and any(turn.age(each) < when.rate.within_ns for each in turn.pulses_ns)
    watching = turn.since_ns is not None if when.absent_for_ns is not None else turn.level and when.edge is not None
    return not (turn.fired or cooling or counting or watching or turn.burst_ns is not None)


def group_of(when: When, event: Mapping[str, Any]) -> str:
    """The group that an event belongs to, at most 256 letters; each has a state of its own."""
    return group_of_fields(event, when.group_by)


def value_of(when: When, event: Mapping[str, Any]) -> float | None:
    """The number at the field that `hysteresis` names, or None."""
    if when.hysteresis is None or not when.hysteresis.field:
        return None
    value = field_at(event, when.hysteresis.field)
    return value if is_number(value) else None


class _Evaluation:
    """A state while it is worked on."""

    def __init__(self, when: When, state: State, now_ns: int) -> None:
        if state.seen_ns is not None and now_ns < state.seen_ns:
            back_ns = state.seen_ns - now_ns
            state, now_ns = (state, state.seen_ns) if back_ns <= SLACK_NS else (_moved(state, -back_ns), now_ns)
        self._when = when
        self.now_ns = now_ns
        self.level, self.held = state.level, state.held
        self.since_ns, self.burst_ns, self.fired_ns = state.since_ns, state.burst_ns, state.fired_ns
        self.pulses_ns = state.pulses_ns
        self.fired = self.ended = False

    def age(self, stamp_ns: int) -> int:
        """How long ago a stamp was."""
        return self.now_ns - stamp_ns

    def elapse(self) -> None:
        """What the time that went by brings about."""
        when = self._when
        if when.absent_for_ns is not None:
            if self.since_ns is not None and not self.held and self.age(self.since_ns) >= when.absent_for_ns:
                self.held = True
                self._act()
            return
        self._lasts()
        if (
            when.debounce is not None
            and self.burst_ns is not None
            and self.age(self.burst_ns) >= when.debounce.quiet_ns
        ):
            self.burst_ns = None
            if not when.debounce.leading:
                self._act()

    def _lasts(self) -> None:
        for_ns = self._when.for_ns
        if self.level and not self.held and self.since_ns is not None and self.age(self.since_ns) >= (for_ns or 0):
            self.held = True
            if self._when.edge in ("rising", "both"):
                self._pulse()

    def observe(self, matched: bool, value: float | None) -> None:
        """An event."""
        when = self._when
        if when.absent_for_ns is not None:
            if matched:
                self.ended, self.held, self.since_ns = self.held, False, self.now_ns
            return
        level = matched
        if when.hysteresis is not None:
            level = when.hysteresis.level(self.level, value) if matched else self.level
        if level and not self.level:
            self.since_ns = self.now_ns
        self.level = level
        if level:
            self._lasts()
        else:
            self._ends()
        if matched and level and when.edge is None:
            self._pulse()

    def _ends(self) -> None:
        was_held, self.held, self.since_ns = self.held, False, None
        if was_held:
            self.ended = True
            if self._when.edge in ("falling", "both"):
                self._pulse()

    def _pulse(self) -> None:
        when = self._when
        if when.rate is not None:
            within = [each for each in self.pulses_ns if self.age(each) < when.rate.within_ns]
            full = len(within) + 1 >= when.rate.count
            self.pulses_ns = () if full else (*within, self.now_ns)
            if not full:
                return
        if when.debounce is None:
            self._act()
            return
        begins, self.burst_ns = self.burst_ns is None, self.now_ns
        if begins and when.debounce.leading:
            self._act()

    def _act(self) -> None:
        cooldown_ns = self._when.cooldown_ns
        if cooldown_ns is not None:
            if self.fired_ns is not None and self.age(self.fired_ns) < cooldown_ns:
                return
            self.fired_ns = self.now_ns
        self.fired = True

    def result(self) -> Step:
        """All of it."""
        state = State(
            level=self.level,
            since_ns=self.since_ns,
            held=self.held,
            pulses_ns=self.pulses_ns,
            burst_ns=self.burst_ns,
            fired_ns=self.fired_ns,
            seen_ns=self.now_ns,
        )
        return Step(state, self.fired, self._due_ns(), self.ended)

    def _due_ns(self) -> int | None:
        when, waits = self._when, []
        if self.since_ns is not None and not self.held:
            waits += [self.since_ns + (when.absent_for_ns or when.for_ns or 0)]
        if self.burst_ns is not None and when.debounce is not None and not when.debounce.leading:
            waits += [self.burst_ns + when.debounce.quiet_ns]
        return min(waits, default=None)


def _moved(state: State, by_ns: int) -> State:
    """The same with all stamps moved."""
    since, burst, fired = (
        None if at is None else at + by_ns for at in (state.since_ns, state.burst_ns, state.fired_ns)
    )
    pulses = tuple(at + by_ns for at in state.pulses_ns)
    return replace(state, since_ns=since, burst_ns=burst, fired_ns=fired, pulses_ns=pulses)
