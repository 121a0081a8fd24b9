"""A rollout: bringing a version to robots in waves, and stopping by itself. Pure; facts and the time go in.

A wave is a number of robots. Its robots are told at once, and the next wave begins when each of them has settled: it
runs the version and is healthy, or it failed. Robots that are offline when their turn comes are passed over, and take
a place in a later wave, or after the last one; so nobody waits for them. A robot fails when it rolled back, refused,
was not healthy within its window, or was offline for longer than allowed while it was at it. As soon as more of a
wave's robots have failed than the plan allows, the rollout halts: those at it go on, and nobody else is told.
"""

from __future__ import annotations

import hashlib
import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field, replace
from typing import Literal

__all__ = [
    "IN_FLIGHT",
    "OPEN",
    "Facts",
    "Member",
    "MemberState",
    "Plan",
    "Rollout",
    "RolloutState",
    "abort",
    "assigned",
    "begin",
    "health_of",
    "pause",
    "refused",
    "resume",
    "step",
    "wave_sizes",
    "withdrawn",
]

RolloutState = Literal["running", "paused", "halted", "done", "aborted"]
MemberState = Literal["waiting", "starting", "updating", "done", "failed", "unreached"]
OPEN: tuple[RolloutState, ...] = ("running", "paused", "halted")
IN_FLIGHT: tuple[MemberState, ...] = ("starting", "updating")
SECOND_NS = 10**9
MAX_WAVES = 32


@dataclass(frozen=True, slots=True, kw_only=True)
class Plan:
    """What to bring, and how carefully. `waves` are counts or percentages ("5%"); the last one holds all the rest.

    `max_failure_rate`: of a wave, 0 to 1. `health_s`: within which a robot has to be healthy. `steady_s`: for how long
    without a break. `offline_s`: for how long it may be offline meanwhile. `give_up_s`: after which robots that never
    came online are left out.
    """

    kind: Literal["agent", "node"]
    node: str
    bundle: str
    version: str
    selector: str
    waves: tuple[str, ...] = ("1", "10%", "50%", "100%")
    max_failure_rate: float = 0.1
    health_s: float = 600.0
    steady_s: float = 10.0
    offline_s: float = 300.0
    give_up_s: float = 7 * 86_400.0

    @property
    def path(self) -> str:
        """Where in the twin the version lies."""
        return "agent.version" if self.kind == "agent" else f"nodes.{self.node}.version"


@dataclass(frozen=True, slots=True, kw_only=True)
class Facts:
    """What is known of a robot now; `good` means: runs the version, and is healthy. `failure`: why it will not be."""

    online: bool
    offline_since_ns: int = 0
    good: bool = False
    failure: str = ""


@dataclass(frozen=True, slots=True, kw_only=True)
class Member:
    """One robot of a rollout. `wave`: in which it was assigned the version, from 1; 0 before. `good_ns`: good since."""

    robot: str
    place: int
    state: MemberState = "waiting"
    wave: int = 0
    since_ns: int = 0
    good_ns: int = 0
    reason: str = ""


@dataclass(frozen=True, slots=True, kw_only=True)
class Rollout:
    """All of it; `wave` counts from 1. `pardoned`: failures of this wave that somebody resumed in spite of."""

    id: str
    plan: Plan
    members: Mapping[str, Member]
    state: RolloutState = "running"
    reason: str = ""
    wave: int = 1
    pardoned: int = 0
    created_ns: int = 0
    created_by: str = ""
    changed_ns: int = 0
    changed: frozenset[str] = field(default=frozenset(), compare=False)  # robots that the last step changed

    @property
    def sizes(self) -> tuple[int, ...]:
        """How many robots each wave has."""
        return wave_sizes(self.plan.waves, len(self.members))

    def count(self, *states: MemberState, wave: int | None = None) -> int:
        """How many robots are in one of these states; of one wave."""
        return sum(m.state in states and wave in (None, m.wave) for m in self.members.values())

    def allowed(self) -> int:
        """How many failures the wave that runs may have."""
        size = self.sizes[self.wave - 1] if self.members else 0
        return math.floor(self.plan.max_failure_rate * size + 1e-9)


def wave_sizes(waves: Iterable[str], robots: int) -> tuple[int, ...]:
    """Counts of the waves: each at least one robot, all together every robot. ValueError for what is no wave."""
    sizes: list[int] = []
    given = list(waves)
    if not 1 <= len(given) <= MAX_WAVES:
        raise ValueError(f"a rollout has 1 to {MAX_WAVES} waves")
    for text in given:
        number = text.removesuffix("%")
        if not (number.isascii() and number.isdigit() and len(number) <= 6) or int(number) < 1:
            raise ValueError(f"wave {text[:20]!r} is neither a number of robots nor a percentage like 10%")
        if text.endswith("%") and int(number) > 100:
            raise ValueError(f"wave {text[:20]!r} is more than all robots")
        left = robots - sum(sizes)
        wanted = math.ceil(int(number) * robots / 100) - sum(sizes) if text.endswith("%") else int(number)
        if left > 0 and wanted > 0:
            sizes.append(min(left, wanted))
    left = robots - sum(sizes)
    return (*sizes, left) if left > 0 else tuple(sizes)


def begin(rollout_id: str, plan: Plan, robots: Iterable[str], *, now_ns: int, created_by: str) -> Rollout:
    """A rollout to these robots; which of them come first depends on its id and theirs alone."""
    ordered = sorted(set(robots), key=lambda robot: hashlib.sha256(f"{rollout_id}|{robot}".encode()).digest())
    members = {robot: Member(robot=robot, place=place, since_ns=now_ns) for place, robot in enumerate(ordered)}
    wave_sizes(plan.waves, len(members))
    made = Rollout(
        id=rollout_id, plan=plan, members=members, created_ns=now_ns, created_by=created_by, changed_ns=now_ns
    )
    return replace(made, changed=frozenset(members))


def step(rollout: Rollout, facts: Mapping[str, Facts], now_ns: int) -> Rollout:
    """What follows from the facts: robots settle, the rollout halts or ends, and robots begin (state `starting`).

    The same rollout, facts and time give the same result. Robots without facts are taken for offline.
    """
    if rollout.state not in OPEN:
        return replace(rollout, changed=frozenset())
    rollout = replace(rollout, changed=frozenset())
    if rollout.state not in OPEN:
        return rollout
    moved = {}
    for robot, member in rollout.members.items():
        if member.state in IN_FLIGHT:
            after = _settle(rollout.plan, member, facts.get(robot), now_ns)
        elif member.state == "waiting":
            after = _wait(rollout, member, facts.get(robot), now_ns)
        else:
            continue
        if after is not member:
            moved[robot] = after
    rollout = _with(rollout, moved, now_ns)
    if rollout.state == "running":
        rollout = _judge(rollout, now_ns)
    if rollout.state == "running":
        rollout = _advance(rollout, facts, now_ns)
    return rollout


def assigned(rollout: Rollout, robot: str, now_ns: int) -> Rollout:
    """The robot's twin holds the version: it is at it from now on."""
    member = rollout.members[robot]
    if member.state != "starting":
        return rollout
    return _with(rollout, {robot: replace(member, state="updating", since_ns=now_ns)}, now_ns)


def refused(rollout: Rollout, robot: str, reason: str, now_ns: int) -> Rollout:
    """The robot's twin cannot hold the version: it has failed."""
    member = replace(rollout.members[robot], state="failed", reason=reason[:500], since_ns=now_ns)
    return _with(rollout, {robot: member}, now_ns)


def pause(rollout: Rollout, reason: str, now_ns: int) -> Rollout:
    """Nobody else is told until `resume`. ValueError when it does not run."""
    if rollout.state != "running":
        raise ValueError(f"it is {rollout.state}, and only what runs can be paused")
    return replace(rollout, state="paused", reason=reason, changed_ns=now_ns, changed=frozenset())


def withdrawn(rollout: Rollout, reason: str, now_ns: int) -> Rollout:
    """Robots cannot fetch the version any more: nobody else is told, not even who had a place already.

    Those at it go on, as they may have it. What the step before this one changed stays to be stored.
    """
    if rollout.state == "running":
        rollout = replace(rollout, state="paused", reason=reason, changed_ns=now_ns)
    return _without_starting(rollout, now_ns)


def resume(rollout: Rollout, now_ns: int, *, version: str = "") -> Rollout:
    """Go on in spite of the failures so far; or with another version, from the first wave, for every robot again.

    Raises:
        ValueError: it is neither paused nor halted, or the version is the one that it has.
    """
    if rollout.state not in ("paused", "halted"):
        raise ValueError(f"it is {rollout.state}, and only what is paused or halted goes on")
    if not version:
        failed = rollout.count("failed", wave=rollout.wave)
        return replace(rollout, state="running", reason="", pardoned=failed, changed_ns=now_ns, changed=frozenset())
    if version == rollout.plan.version:
        raise ValueError(f"{version} is the version that failed; leave it out to go on with it")
    again = {
        robot: Member(robot=robot, place=member.place, since_ns=now_ns) for robot, member in rollout.members.items()
    }
    fresh = replace(
        rollout, plan=replace(rollout.plan, version=version), state="running", reason="", wave=1, pardoned=0
    )
    return _with(fresh, again, now_ns)


def abort(rollout: Rollout, reason: str, now_ns: int) -> Rollout:
    """End it: who waits is left out, and who has the version, or is at it, keeps it. ValueError when it is over."""
    if rollout.state not in OPEN:
        raise ValueError(f"it is {rollout.state} already")
    over = replace(rollout, state="aborted", reason=reason, changed_ns=now_ns, changed=frozenset())
    return _without_starting(over, now_ns)


def health_of(plan: Plan, reported: Mapping[str, object] | None) -> tuple[bool, str]:
    """Whether what a robot reports of itself is good, and why it never will be; (False, "") while that is open."""
    part = _part(plan, reported)
    update = part.get("update")
    state, about = (str(update.get("state", "")), update.get("version")) if isinstance(update, Mapping) else ("", None)
    if about == plan.version and state in ("rolled_back", "refused") and isinstance(update, Mapping):
        said = plain(str(update.get("message") or update.get("code") or ""))
        return False, f"{state}{f': {said}' if said else ''}"
    if part.get("version") != plan.version or state in ("downloading", "staged", "trying"):
        return False, ""
    if plan.kind == "node":
        if part.get("state") == "quarantined" or part.get("quarantined"):
            return False, "quarantined: the node keeps ending"
        return part.get("state") == "running", ""
    return True, ""


def plain(text: str) -> str:
    """A robot's own words as one line that any database, terminal and page takes."""
    return "".join(letter if letter.isprintable() else " " for letter in text[:200]).strip()


def _part(plan: Plan, reported: Mapping[str, object] | None) -> Mapping[str, object]:
    found: object = (reported or {}).get("agent")
    if plan.kind == "node":
        nodes = (reported or {}).get("nodes")
        found = nodes.get(plan.node) if isinstance(nodes, Mapping) else None
    return found if isinstance(found, Mapping) else {}


def _settle(plan: Plan, member: Member, facts: Facts | None, now_ns: int) -> Member:
    if member.state == "starting":  # its twin does not hold the version yet: nothing of it counts
        return member
    facts = facts or Facts(online=False, offline_since_ns=member.since_ns)
    if facts.failure:
        return replace(member, state="failed", reason=facts.failure, since_ns=now_ns, good_ns=0)
    good = facts.online and facts.good
    good_ns = (member.good_ns or now_ns) if good else 0
    if good and now_ns - good_ns >= plan.steady_s * SECOND_NS:
        return replace(member, state="done", reason="", since_ns=now_ns, good_ns=good_ns)
    if not facts.online and now_ns - max(facts.offline_since_ns, member.since_ns) > plan.offline_s * SECOND_NS:
        return replace(
            member, state="failed", reason=f"offline for more than {plan.offline_s:g} s", since_ns=now_ns, good_ns=0
        )
    if now_ns - member.since_ns > (plan.health_s + (plan.steady_s if good else 0.0)) * SECOND_NS:
        reason = f"not healthy within {plan.health_s:g} s"
        return replace(member, state="failed", reason=reason, since_ns=now_ns, good_ns=0)
    return member if good_ns == member.good_ns else replace(member, good_ns=good_ns)


def _wait(rollout: Rollout, member: Member, facts: Facts | None, now_ns: int) -> Member:
    """Who waits and was never reached for so long is left out; time that the rollout does not run counts, too."""
    if facts is not None and facts.online:
        return member
    since_ns = max(member.since_ns, facts.offline_since_ns if facts is not None else 0)
    if now_ns - since_ns > rollout.plan.give_up_s * SECOND_NS:
        return replace(member, state="unreached", reason="offline all the time", since_ns=now_ns)
    return member


def _judge(rollout: Rollout, now_ns: int) -> Rollout:
    failed, allowed = rollout.count("failed", wave=rollout.wave) - rollout.pardoned, rollout.allowed()
    if failed <= allowed:
        return rollout
    reasons = sorted(
        f"{m.robot} {m.reason}" for m in rollout.members.values() if m.state == "failed" and m.wave == rollout.wave
    )
    shown = "; ".join(reasons[:5]) + ("; …" if len(reasons) > 5 else "")
    reason = f"wave {rollout.wave}: {failed} failed, at most {allowed} may: {shown}"
    return replace(rollout, state="halted", reason=reason[:1000], changed_ns=now_ns)


def _advance(rollout: Rollout, facts: Mapping[str, Facts], now_ns: int) -> Rollout:
    """Fill the wave's places from who is online; the next wave when it is full and settled."""
    while rollout.count("waiting", *IN_FLIGHT):
        room = rollout.sizes[rollout.wave - 1] - _used(rollout)
        ready = [
            member
            for member in sorted(rollout.members.values(), key=lambda member: member.place)
            if member.state == "waiting" and (known := facts.get(member.robot)) is not None and known.online
        ]
        starting = {
            member.robot: replace(member, state="starting", wave=rollout.wave, since_ns=now_ns)
            for member in ready[:room]
        }
        if starting:
            return _with(rollout, starting, now_ns)
        if room > 0 or rollout.count(*IN_FLIGHT):  # where places are left, nobody else is online: they stay open
            return rollout
        rollout = replace(rollout, wave=rollout.wave + 1, pardoned=0, changed_ns=now_ns)
    return replace(rollout, state="done", reason="", changed_ns=now_ns)


def _used(rollout: Rollout) -> int:
    """Places of the running wave that are taken, settled or not."""
    return sum(member.wave == rollout.wave for member in rollout.members.values())


def _without_starting(rollout: Rollout, now_ns: int) -> Rollout:
    """Who has a place and was not told yet waits again."""
    taken_back = {
        robot: replace(member, state="waiting", wave=0, since_ns=now_ns)
        for robot, member in rollout.members.items()
        if member.state == "starting"
    }
    return _with(rollout, taken_back, now_ns)


def _with(rollout: Rollout, moved: Mapping[str, Member], now_ns: int) -> Rollout:
    if not moved:
        return rollout
    return replace(
        rollout,
        members={**rollout.members, **moved},
        changed_ns=now_ns,
        changed=rollout.changed | moved.keys(),
    )
