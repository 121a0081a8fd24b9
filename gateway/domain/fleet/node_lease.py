"""Leases of migratable nodes: which robot may run a node, and when another one may. Pure; time is an argument.

A robot counts its lease from a moment of its own clock that it told us; we count the same lease from when we heard of
that moment, which is later. So our end of a lease is never before the robot's, whatever was lost, repeated, or lay in a
buffer on the way, and no calendar has a part in it: clocks may be set. What two clocks may differ in speed is in the
margin. Words of another gateway, or of this one in an earlier life, are known by the store alone: who sees a row as he
has not seen it before takes it for given just now.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, replace

__all__ = ["LeaseTerms", "NodeLeases", "Step", "Unit", "UnitLease"]


@dataclass(frozen=True, slots=True, order=True)
class Unit:
    """What runs once in a fleet: a node of a template, or of one robot's own document."""

    scope: str  # a template's name, or robot/ID
    node: str


@dataclass(frozen=True, slots=True, kw_only=True)
class UnitLease:
    """A unit's lease, as the store keeps it."""

    unit: Unit
    robot: str
    lease_id: str
    epoch: int  # grows by one whenever the unit moves: the fencing number
    renewals: int  # grows by one with every write: how others see that it goes on
    keeper: str  # the gateway that renews it, in this life of its
    since_ns: int  # wall clock, for people: when the robot got it


@dataclass(frozen=True, slots=True)
class Step:
    """A lease that begins or goes on. It counts for the robot only once `after` is where it belongs."""

    before: UnitLease | None
    after: UnitLease
    boot_ns: int  # of the robot's clock: from there the robot counts
    heard_s: float  # when we heard of that moment, and count from
    until_s: float

    @property
    def written(self) -> bool:
        """Whether the store has to have it before the robot hears of it."""
        return self.before != self.after


@dataclass(frozen=True, slots=True, kw_only=True)
class LeaseTerms:
    """How long what is good."""

    valid_s: float  # a lease
    margin_s: float  # from its end here to the next one's begin: clocks that run apart
    answer_s: float  # a robot that was silent for so long gets nothing new
    shunned_s: float  # so long a unit rather goes to another robot than to one where it failed


@dataclass(slots=True)
class _UnitLease:
    """A row and what we make of it."""

    held: UnitLease
    until_s: float  # nobody has it later, by our clock
    boot_ns: int | None = None  # from where its robot counts; None: that was not told over the link that it has now
    heard_s: float = float("-inf")  # when that was told
    released: bool = False  # its robot is told to let it go


@dataclass(frozen=True, slots=True)
class _Stamp:
    boot_ns: int
    heard_s: float


class NodeLeases:
    """All units that this gateway knows. Robots are those that are linked to it."""

    def __init__(self, keeper: str, terms: LeaseTerms, *, shared: bool) -> None:
        """`shared`: other gateways look at the same rows, so that a renewal has to be seen in them, too."""
        self._keeper = keeper
        self._terms = terms
        self._shared = shared
        self._known: dict[Unit, _UnitLease] = {}
        self._offers: dict[Unit, dict[str, bool]] = {}
        self._units: dict[str, Mapping[Unit, bool]] = {}
        self._stamps: dict[str, _Stamp] = {}
        self._first_s: dict[Unit, float] = {}  # units without a row: since when we have looked for one
        self._shunned: dict[tuple[Unit, str], float] = {}
        self._under_way: frozenset[Unit] = frozenset()

    # -- what is heard ---------------------------------------------------------------------------------------------

    def offer(self, robot: str, units: Mapping[Unit, bool]) -> None:
        """The units that a robot has in its table, and whether each could run there."""
        for unit in self._units.pop(robot, {}):
            self._offers[unit].pop(robot, None)
            if not self._offers[unit]:
                del self._offers[unit]
        if units:
            self._units[robot] = units
        for unit, able in units.items():
            self._offers.setdefault(unit, {})[robot] = able

    def answered(self, robot: str, boot_ns: int, *, now_s: float) -> None:
        """A robot told a moment of its clock, over the link that it has now."""
        self._stamps[robot] = _Stamp(boot_ns, now_s)

    def linked(self, robot: str) -> None:
        """It has another link, or none: what it told over the one before is not to be used."""
        self._stamps.pop(robot, None)
        for known in self._known.values():
            if known.held.robot == robot:
                known.boot_ns = None

    def learn(self, rows: Iterable[UnitLease], *, now_s: float) -> None:
        """All rows of the store, as they were read before `now_s`, and after every write of ours had its end."""
        known: dict[Unit, _UnitLease] = {}
        for row in rows:
            was = self._known.get(row.unit)
            same = was is not None and was.held == row
            known[row.unit] = was if was is not None and same else _UnitLease(row, now_s + self._terms.valid_s)
            self._first_s.pop(row.unit, None)
        self._known = known
        self._under_way = frozenset()

    # -- what comes of it ------------------------------------------------------------------------------------------

    @property
    def robots(self) -> Iterable[str]:
        """Those that have migratable nodes: they are asked."""
        return self._units.keys()

    def holder(self, unit: Unit, *, now_s: float) -> UnitLease | None:
        """Who may have it now."""
        known = self._known.get(unit)
        return known.held if known is not None and now_s < known.until_s else None

    def plan(self, *, now_s: float, wall_ns: int) -> list[Step]:
        """The leases that may begin or go on now, in the order of their units."""
        self._forget(now_s)
        holders = (self._known[unit].held.robot for unit in self._offers if unit in self._known)
        load = Counter(holders)
        steps = []
        for unit in sorted(self._offers.keys() - self._under_way):
            known = self._known.get(unit)
            if known is not None and self._goes_on(unit, known, now_s):
                step = self._renewal(known)
            elif self._is_over(unit, known, now_s):
                step = self._move(unit, known, load, now_s=now_s, wall_ns=wall_ns)
            else:
                continue
            if step is not None:
                steps.append(step)
        return steps

    def begin(self, steps: Iterable[Step]) -> None:
        """These are being written: nothing else happens to their units until `learn` says what came of it."""
        self._under_way = frozenset(step.after.unit for step in steps)

    def took(self, steps: Iterable[Step]) -> None:
        """These are where they belong."""
        for step in steps:
            unit, robot = step.after.unit, step.after.robot
            was = self._known.get(unit)
            until_s = step.until_s if was is None else max(step.until_s, was.until_s)
            self._known[unit] = _UnitLease(step.after, until_s, step.boot_ns, step.heard_s)
            self._first_s.pop(unit, None)
            if step.before is None or step.before.epoch != step.after.epoch:
                self._shunned.pop((unit, robot), None)

    def frame(self, robot: str) -> tuple[int, list[UnitLease]]:
        """The frame for a robot: all that it holds, and the moment of its clock from which that counts. 0 is a question
        for a moment, and no word about leases: we know of none over this link, or of a lease that we do not keep yet.
        """
        stamp = self._stamps.get(robot)
        found = (self._known.get(unit) for unit in self._units.get(robot, {}))
        held = [known for known in found if known is not None and known.held.robot == robot and not known.released]
        moments = [known.boot_ns for known in held if known.boot_ns is not None]
        if stamp is None or len(moments) < len(held):
            return 0, []
        return min(moments, default=stamp.boot_ns), [known.held for known in held]

    # -- parts -----------------------------------------------------------------------------------------------------

    def _answers(self, robot: str, now_s: float) -> bool:
        stamp = self._stamps.get(robot)
        return stamp is not None and now_s - stamp.heard_s < self._terms.answer_s

    def _can_take(self, unit: Unit, robot: str, now_s: float) -> bool:
        """Whether the unit could run on a robot that answers."""
        return self._answers(robot, now_s) and self._offers[unit].get(robot, False)

    def _is_over(self, unit: Unit, known: _UnitLease | None, now_s: float) -> bool:
        """Whether nobody can have it any more. One without a row may have run under another template until now."""
        first_s = self._first_s.setdefault(unit, now_s) if known is None else now_s
        until_s = known.until_s if known is not None else first_s + self._terms.valid_s
        return now_s >= until_s + self._terms.margin_s

    def _goes_on(self, unit: Unit, known: _UnitLease, now_s: float) -> bool:
        """Whether its robot is here and keeps it: until it is lost, or has come to grief and another one is able."""
        robot, offers = known.held.robot, self._offers[unit]
        if robot not in offers:
            known.released = robot in self._units  # it is here, and has the node in its table no more
            return False
        if not self._answers(robot, now_s):
            return False
        well = offers[robot] and (unit, robot) not in self._shunned
        known.released = not well and any(
            (unit, one) not in self._shunned and self._can_take(unit, one, now_s) for one in offers if one != robot
        )
        if known.released:
            self._shunned.setdefault((unit, robot), now_s + self._terms.shunned_s)
        return not known.released

    def _renewal(self, known: _UnitLease) -> Step | None:
        """Its next term, where its robot has told a moment since."""
        held, stamp = known.held, self._stamps[known.held.robot]
        if known.boot_ns is not None and stamp.heard_s <= known.heard_s:
            return None
        after = held
        if self._shared or held.keeper != self._keeper:
            after = replace(held, renewals=held.renewals + 1, keeper=self._keeper)
        return self._step(held, after)

    def _step(self, before: UnitLease | None, after: UnitLease) -> Step:
        stamp = self._stamps[after.robot]
        return Step(before, after, stamp.boot_ns, stamp.heard_s, stamp.heard_s + self._terms.valid_s)

    def _move(
        self, unit: Unit, known: _UnitLease | None, load: Counter[str], *, now_s: float, wall_ns: int
    ) -> Step | None:
        """To the robot that is able, was not shunned, holds least, and comes first by its name."""
        able = [robot for robot in self._offers[unit] if self._can_take(unit, robot, now_s)]
        if not able:
            return None
        robot = min(able, key=lambda one: ((unit, one) in self._shunned, load[one], one))
        load[robot] += 1
        before = known.held if known is not None else None
        epoch = before.epoch + 1 if before is not None else 1
        after = UnitLease(
            unit=unit,
            robot=robot,
            lease_id=f"{self._keeper}.{epoch}",
            epoch=epoch,
            renewals=before.renewals + 1 if before is not None else 1,
            keeper=self._keeper,
            since_ns=wall_ns,
        )
        return self._step(before, after)

    def _forget(self, now_s: float) -> None:
        for key in [key for key, until_s in self._shunned.items() if now_s >= until_s]:
            del self._shunned[key]
        for unit in [unit for unit in self._first_s if unit not in self._offers]:
            del self._first_s[unit]
