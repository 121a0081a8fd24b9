"""One alert in the registry: which findings it groups, what follows from them, and what of it is not stored yet."""

from __future__ import annotations

import heapq
from dataclasses import replace
from math import isfinite

from gateway.alerting.alerts.causes import title_of
from gateway.domain.alert import Alert, Evidence, rank
from gateway.domain.finding import Finding

__all__ = ["Entry", "Key", "merged", "new_alert"]

Key = tuple[str, str, str]  # a finding's
TEXT_CHARS = 500
LATEST_S = 2.0**32  # of a robot's stamps that a calendar shows
PART_OF_OPENING = ("changed", "escalated")


class Entry:
    """An alert and its findings; `news` is what is to be told once it is stored; "seen" is no news for people."""

    def __init__(self, alert: Alert, *, active: int, shown: int) -> None:
        """At most so many findings are `active`, and `shown` ones are in the alert."""
        self.alert = alert
        self.active: dict[Key, Evidence] = {}
        self.ended: dict[Key, Evidence] = {}
        self.unsure: set[Key] = set()  # from before a restart, and not told again yet
        self.news: list[str] = []
        self.owner = alert.gateway  # who judges the robot, as the store had it last
        self.stored_ns = 0
        self._most, self._shown = active, shown
        self.take_evidence(alert)

    @property
    def dirty(self) -> bool:
        """Whether it is not stored as it is."""
        return bool(self.news)

    @property
    def held(self) -> bool:
        """Whether somebody resolved it while what it is about went on."""
        return not self.alert.unresolved and bool(self.active)

    @property
    def urgent(self) -> bool:
        """Whether it is news for people."""
        return any(what != "seen" for what in self.news)

    def take_evidence(self, alert: Alert) -> None:
        """Forget which findings there are, and believe a stored alert."""
        self.active = {item.finding.key: item for item in alert.findings if item.active}
        self.ended = {item.finding.key: item for item in alert.findings if not item.active}
        self.unsure &= self.active.keys()

    def begin(self, finding: Finding, now_ns: int) -> bool:
        """A finding began, or is told again; whether it is a new one."""
        known = self.active.get(finding.key)
        if known is None and len(self.active) >= self._most:
            return False
        self.unsure.discard(finding.key)
        self.ended.pop(finding.key, None)
        self.active[finding.key] = Evidence(finding=finding, told_ns=known.told_ns if known else now_ns)
        return known is None

    def end(self, key: Key, now_ns: int) -> None:
        """A finding is over."""
        self.unsure.discard(key)
        known = self.active.pop(key, None)
        if known is None:
            return
        self.ended[key] = replace(known, ended_ns=now_ns)
        while len(self.ended) > self._shown:
            self.ended.pop(next(iter(self.ended)))

    def release(self, gateway: str) -> None:
        """What this gateway took over and did not store yet is the other one's still."""
        if self.alert.revision and self.owner != gateway:
            self.alert, self.news = replace(self.alert, gateway=self.owner), []

    def note_change(self, what: str) -> None:
        """Something is to be stored, and then told."""
        if what in self.news or ("opened" in self.news and what in PART_OF_OPENING) or (what == "seen" and self.news):
            return
        self.news = [*(said for said in self.news if said != "seen"), what]

    def refresh(self, now_ns: int) -> None:
        """Bring the alert up to its findings: which, how bad, over since when; a resolved one stays as bad."""
        shown = heapq.nsmallest(self._shown, self.active.values(), key=_badness)
        rest = heapq.nsmallest(self._shown - len(shown), self.ended.values(), key=_badness)
        before = self.alert
        changes: dict[str, object] = {"findings": (*shown, *rest)}
        if shown and before.unresolved:
            changes |= {"clear_ns": 0, **_face(shown[0].finding)}
        elif not shown and not before.clear_ns:
            changes["clear_ns"] = now_ns
        worst = max([before.severity, *(item.finding.severity for item in shown[:1])], key=rank)
        if before.unresolved and worst != before.severity:
            changes["severity"] = worst
            self.note_change("escalated")
        after = replace(before, **changes)  # type: ignore[arg-type]
        if after != before:
            self.alert = replace(after, changed_ns=now_ns)
            self.note_change("seen")

    def resolve(self, now_ns: int) -> None:
        """It is over by itself."""
        self.alert = replace(self.alert, state="resolved", resolved_ns=now_ns, resolved_by="", changed_ns=now_ns)
        self.note_change("resolved")

    def reopen(self, now_ns: int) -> None:
        """It began again: nobody has acknowledged that."""
        worst = min(self.active.values(), key=_badness).finding.severity
        self.alert = replace(
            self.alert,
            state="open",
            severity=worst,
            resolved_ns=0,
            resolved_by="",
            acknowledged_ns=0,
            acknowledged_by="",
            clear_ns=0,
            times=self.alert.times + 1,
            seen_ns=now_ns,
            changed_ns=now_ns,
        )
        self.note_change("opened")


def new_alert(finding: Finding, alert_id: str, *, gateway: str, now_ns: int) -> Alert:
    """What a finding opens."""
    return Alert(
        id=alert_id,
        robot=finding.robot,
        cause=finding.cause,
        state="open",
        severity=finding.severity,
        title=title_of(finding.cause),
        opened_ns=now_ns,
        first_ns=round(finding.since_s * 1e9) if 0 <= finding.since_s < LATEST_S else now_ns,
        changed_ns=now_ns,
        seen_ns=now_ns,
        gateway=gateway,
    )


def merged(ours: Alert, stored: Alert) -> Alert:
    """One alert of what its findings made of it here, and of what people did to it elsewhere meanwhile."""
    both = replace(
        ours,
        id=stored.id,
        opened_ns=stored.opened_ns,
        first_ns=stored.first_ns,
        acknowledged_ns=stored.acknowledged_ns,
        acknowledged_by=stored.acknowledged_by,
        assignee=stored.assignee,
        clip=stored.clip or ours.clip,
        times=max(ours.times, stored.times),
        severity=max(ours.severity, stored.severity, key=rank),
        revision=stored.revision,
    )
    if ours.unresolved:
        both = replace(both, state=stored.state, resolved_ns=stored.resolved_ns, resolved_by=stored.resolved_by)
    return both


def _badness(item: Evidence) -> tuple[int, float, int]:
    return -rank(item.finding.severity), -item.finding.score, -item.told_ns


def _face(finding: Finding) -> dict[str, object]:
    """What an alert shows of its worst finding."""
    return {
        "reason": finding.reason.replace("\0", "")[:TEXT_CHARS],
        "series": finding.series,
        "detector": finding.kind,
        "score": finding.score,
        "value": _number(finding.value),
        "low": _number(finding.low),
        "high": _number(finding.high),
    }


def _number(value: float) -> float | None:
    return value if isfinite(value) else None
