"""The registry of alerts: edges of findings and `now` in, alerts to store out. Pure: no clock, no store, no tasks.

There is one entry for each robot and cause: the alert that is not resolved, or else the last one, as long as it may
begin again. Every beginning and every end changes the registry at once; `changes` says what is to be stored, and
its caller answers each with `stored`, `clashed` or `failed`. What comes from the store, by whomever, is `learn`ed.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Callable, Collection, Iterable, Iterator, Sequence
from dataclasses import replace

from gateway.alerting.alerts.capacity import Capacity
from gateway.alerting.alerts.change import Change
from gateway.alerting.alerts.config import AlertConfig
from gateway.alerting.alerts.entry import Entry, Key, merged, new_alert
from gateway.alerting.alerts.inhibition import Inhibitor
from gateway.alerting.alerts.overflow import OverflowQueue
from gateway.domain.alert import Alert, Silence, new_alert_id, rank
from gateway.domain.finding import Edge, Finding
from metaros.limits import LIMITS, Limits

__all__ = ["AlertRegistry", "Change"]

Place = tuple[str, str]  # robot, cause
ELSEWHERE_S = 60.0  # longer than its own gateway another one waits
AT_ONCE = 32  # alerts of a piece of a tick


class AlertRegistry:
    """Not thread-safe: the event loop owns it."""

    def __init__(
        self,
        *,
        gateway: str,
        limits: Limits = LIMITS,
        config: AlertConfig | None = None,
        topics_of: Callable[[str, str], Collection[str]] = lambda robot, node: (),
        new_id: Callable[[int], str] = new_alert_id,
    ) -> None:
        self._gateway = gateway
        self._limits = limits
        self._config = config or AlertConfig()
        self._new_id = new_id
        self._inhibitor = Inhibitor(topics_of)
        self._entries: dict[Place, Entry] = {}
        self._by_id: dict[str, Entry] = {}
        self._causes: defaultdict[str, set[str]] = defaultdict(set)  # of each robot, what there are entries of
        self._places: dict[Key, Place] = {}  # where each active finding is
        self._capacity = Capacity(limits)
        self._overflow = OverflowQueue(limits.alert_findings_waiting)
        self._unquiet: list[str] = []  # robots whose alerts have not met the silences of now yet
        self._leaving: list[Change] = []
        self._grace: dict[str, int] = {}

    @property
    def refused(self) -> int:
        """Findings that there was no room for, not even to wait."""
        return self._overflow.refused

    @property
    def waiting(self) -> int:
        """Findings that wait for room."""
        return len(self._overflow)

    @property
    def unresolved(self) -> int:
        """How many alerts are not resolved."""
        return self._capacity.taken

    def apply(self, edges: Iterable[Edge], now_ns: int) -> None:
        """What the evaluator says: every end counts, and every beginning as far as there is room."""
        touched: set[Place] = set()
        for edge in edges:
            finding = edge.finding
            place = (finding.robot, finding.cause)
            before = self._places.get(finding.key)
            if before is not None and (edge.change == "cleared" or before != place):
                self._end(finding.key, before, now_ns)
                touched.add(before)
            self._overflow.end(finding.key)
            if edge.change != "cleared" and self._begin(finding, place, now_ns):
                touched.add(place)
        self._refresh(touched, now_ns)

    def tick(self, now_ns: int) -> None:
        """What time does: graces run out, alerts resolve, the old are forgotten, silences begin and end."""
        for _ in self.ticking(now_ns):
            pass

    def ticking(self, now_ns: int) -> Iterator[None]:
        """A tick in pieces: between them the registry may get more findings, and change."""
        for robot in [robot for robot, until_ns in self._grace.items() if until_ns <= now_ns]:
            if self._grace.get(robot, now_ns + 1) <= now_ns:
                self._end_unsure(robot, now_ns)
            yield
        for number, (place, entry) in enumerate(list(self._entries.items())):
            if self._entries.get(place) is entry:
                self._age(place, entry, now_ns)
            if number % AT_ONCE == AT_ONCE - 1:
                yield
        self._look_at_silences(now_ns)
        while self._unquiet:
            yield
            self._look_at_silences(now_ns)
        yield from self._make_room(now_ns)

    def adopt(self, robot: str, now_ns: int) -> None:
        """From now on this gateway judges the robot: what it does not tell again within the grace is over."""
        self._grace[robot] = now_ns + round(self._config.grace_s * 1e9)
        for cause in self._causes.get(robot, ()):
            self._doubt(self._entries[robot, cause])

    def release(self, robot: str) -> None:
        """Another gateway judges the robot from now on."""
        self._grace.pop(robot, None)
        for cause in self._causes.get(robot, ()):
            self._entries[robot, cause].release(self._gateway)

    def of(self, robot: str) -> tuple[Alert, ...]:
        """The robot's alerts that are not resolved, the worst first."""
        found = (self._entries[robot, cause].alert for cause in self._causes.get(robot, ()))
        return tuple(sorted((item for item in found if item.unresolved), key=lambda a: (-rank(a.severity), a.id)))

    def all(self) -> Iterable[Alert]:
        """Every alert in the registry, resolved ones too."""
        return (entry.alert for entry in self._entries.values())

    def revisions(self) -> dict[str, int]:
        """The alerts here that can still change, as the store had them, and how often each was stored."""
        live = (item.alert for item in self._entries.values() if item.alert.unresolved or item.held)
        return {alert.id: alert.revision for alert in live if alert.revision}

    def silence(self, silences: Sequence[Silence], now_ns: int) -> None:
        """The silences that are not over."""
        self._inhibitor.set_silences(silences)
        self._look_at_silences(now_ns)

    def changes(self, now_ns: int, *, most: int, all_of_it: bool = False) -> list[Change]:
        """What is to be stored, at most so many alerts; what is no news of people's only every `settle_s`."""
        found, self._leaving = self._leaving[:most], self._leaving[most:]
        settle_ns = round(self._config.settle_s * 1e9)
        for entry in self._entries.values():
            if len(found) >= most:
                break
            if entry.dirty and (all_of_it or entry.urgent or abs(now_ns - entry.stored_ns) >= settle_ns):
                found.append(Change(entry.alert, tuple(entry.news)))
                entry.news, entry.stored_ns = [], now_ns
        return found

    def stored(self, change: Change) -> None:
        """It is in the store, as the next revision."""
        entry = self._by_id.get(change.alert.id)
        if entry is not None and entry.alert.revision == change.alert.revision:
            entry.alert = replace(entry.alert, revision=change.alert.revision + 1)
            entry.owner = change.alert.gateway

    def failed(self, change: Change) -> None:
        """It is not in the store: it is a change still."""
        entry = self._by_id.get(change.alert.id)
        if entry is None:
            self._leaving.append(change)
            return
        entry.news = [*change.news, *(what for what in entry.news if what not in change.news)]
        entry.stored_ns = 0

    def clashed(self, change: Change, stored: Alert | None, now_ns: int) -> None:
        """Somebody else was faster, and this is what is in the store now; None: it was deleted."""
        entry = self._by_id.get(change.alert.id)
        if entry is None:
            return
        if stored is None:
            entry.alert = replace(entry.alert, revision=0)
            self.failed(change)
            return
        self.failed(change)
        self._merge((change.alert.robot, change.alert.cause), entry, stored, now_ns)

    def learn(self, stored: Alert, now_ns: int) -> None:
        """An alert as the store has it, whoever changed it."""
        place = (stored.robot, stored.cause)
        entry = self._entries.get(place)
        if entry is None and not self._may_come_back(stored, now_ns):
            return
        if entry is None or (entry.alert.id != stored.id and not entry.alert.unresolved and stored.unresolved):
            if entry is not None and entry.dirty:
                self._leaving.append(Change(entry.alert, tuple(entry.news)))
            fresh = self._put(place, stored)
            if stored.robot in self._grace:
                self._doubt(fresh)
            if entry is not None:
                fresh.unsure = (fresh.unsure - entry.active.keys()) | entry.unsure
                fresh.active |= entry.active
            self._claim(place, fresh)
        elif entry.dirty or entry.alert.id != stored.id:
            if stored.unresolved or entry.alert.id == stored.id:
                self._merge(place, entry, stored, now_ns)
        elif stored.revision >= entry.alert.revision:
            self._believe(place, entry, stored)
        self._requiet(stored.robot)

    def forget(self, alert_id: str) -> None:
        """The alert is not in the store any more."""
        entry = self._by_id.get(alert_id)
        if entry is not None and not entry.dirty:
            self._drop((entry.alert.robot, entry.alert.cause), entry)

    def _begin(self, finding: Finding, place: Place, now_ns: int) -> bool:
        entry = self._entries.get(place)
        if entry is None or (not entry.alert.unresolved and not self._may_go_on(entry, finding, now_ns)):
            if not self._capacity.has(place):
                self._overflow.add(finding)
                return False
            entry = self._open_new(finding, place, entry, now_ns)
        fresh = entry.begin(finding, now_ns)
        self._claim(place, entry, finding.key)
        if not entry.alert.unresolved:
            self._begin_again(entry, finding, fresh=fresh, now_ns=now_ns)
        elif fresh:
            again = entry.alert.times + (entry.alert.clear_ns > 0)
            entry.alert = replace(entry.alert, times=again, seen_ns=now_ns, clear_ns=0, gateway=self._gateway)
            entry.note_change("changed")
        else:
            entry.alert = replace(entry.alert, seen_ns=now_ns, gateway=self._gateway)
            entry.note_change("seen")
        return True

    def _begin_again(self, entry: Entry, finding: Finding, *, fresh: bool, now_ns: int) -> None:
        place = (finding.robot, finding.cause)
        worse = rank(finding.severity) > rank(entry.alert.severity)
        if (fresh or worse) and self._capacity.has(place):  # else it is known to whoever resolved it
            entry.alert = replace(entry.alert, gateway=self._gateway)
            entry.reopen(now_ns)
            self._capacity.count(place, 1)

    def _may_go_on(self, entry: Entry, finding: Finding, now_ns: int) -> bool:
        """Whether a resolved alert is the one that a finding belongs to."""
        if finding.key in entry.active:
            return True
        return self._is_recent(entry.alert, now_ns) and self._capacity.has((entry.alert.robot, entry.alert.cause))

    def _may_come_back(self, alert: Alert, now_ns: int) -> bool:
        return alert.unresolved or not alert.clear_ns or self._is_recent(alert, now_ns)

    def _is_recent(self, alert: Alert, now_ns: int) -> bool:
        return abs(now_ns - alert.resolved_ns) < self._config.cooldown_s * 1e9

    def _open_new(self, finding: Finding, place: Place, before: Entry | None, now_ns: int) -> Entry:
        kept = before.active if before is not None else {}
        alert = new_alert(finding, self._new_id(now_ns), gateway=self._gateway, now_ns=now_ns)
        worst = max([finding.severity, *(item.finding.severity for item in kept.values())], key=rank)
        if before is not None and (kept or before.dirty):  # what it is about is the new one's from now on
            over = replace(before.alert, clear_ns=before.alert.clear_ns or now_ns, changed_ns=now_ns)
            self._leaving.append(Change(over, tuple(before.news)))
        entry = self._put(place, replace(alert, severity=worst))
        entry.active = dict(kept)
        entry.unsure = before.unsure & kept.keys() if before is not None else set()
        self._claim(place, entry)
        entry.note_change("opened")
        return entry

    def _end(self, key: Key, place: Place, now_ns: int) -> None:
        del self._places[key]
        self._entries[place].end(key, now_ns)

    def _refresh(self, places: Iterable[Place], now_ns: int) -> None:
        robots = set()
        for place in places:
            entry = self._entries.get(place)
            if entry is not None:
                entry.refresh(now_ns)
                robots.add(place[0])
        for robot in robots:
            self._requiet(robot)

    def _end_unsure(self, robot: str, now_ns: int) -> None:
        del self._grace[robot]
        for cause in self._causes.get(robot, ()):
            entry = self._entries[robot, cause]
            for key in list(entry.unsure):
                self._end(key, (robot, cause), now_ns)
            entry.refresh(now_ns)
        self._requiet(robot)

    def _age(self, place: Place, entry: Entry, now_ns: int) -> None:
        alert = entry.alert
        if alert.unresolved:
            if alert.clear_ns > now_ns:  # the calendar was set back
                entry.alert = replace(alert, clear_ns=now_ns)
            elif alert.clear_ns and now_ns - alert.clear_ns >= self._clear_s(alert) * 1e9:
                entry.resolve(now_ns)
                self._capacity.count(place, -1)
                self._requiet(alert.robot)
        elif not (entry.active or entry.dirty) and not self._is_recent(alert, now_ns):
            self._drop(place, entry)

    def _clear_s(self, alert: Alert) -> float:
        """Whose robot it is says that it is over; where that gateway ended, another one does."""
        return self._config.clear_s + (0.0 if alert.gateway == self._gateway else ELSEWHERE_S)

    def _look_at_silences(self, now_ns: int) -> None:
        """Hold the alerts of some robots against silences; `ticking` goes on with the others."""
        if self._inhibitor.refresh(now_ns):
            self._unquiet = list(self._causes)
        for _ in range(min(len(self._unquiet), self._inhibitor.robots_at_once)):
            self._requiet(self._unquiet.pop())

    def _requiet(self, robot: str) -> None:
        """Which of a robot's alerts are explained by another, or silenced."""
        mine = [self._entries[robot, cause] for cause in self._causes.get(robot, ())]
        alerts = [entry.alert for entry in mine if entry.alert.unresolved]
        for entry in mine:
            alert = entry.alert
            if not alert.unresolved:
                continue
            why, silence = self._inhibitor.of(alert, alerts)
            if (why, silence) != (alert.inhibited_by, alert.silence):
                entry.alert = replace(alert, inhibited_by=why, silence=silence)
                if alert.gateway == self._gateway:
                    entry.note_change("changed")

    def _make_room(self, now_ns: int) -> Iterator[None]:
        """What waits for room gets it, and where some does still, an alert says so."""
        for number, finding in enumerate(self._overflow.first(self._limits.alerts_unresolved)):
            place = (finding.robot, finding.cause)
            if self._capacity.has(place) and (now := self._overflow.end(finding.key)) is not None:
                self.apply([Edge("opened", now, now_ns / 1e9)], now_ns)
            if number % AT_ONCE == AT_ONCE - 1:
                yield
        self.apply(self._overflow.news(now_ns, full=self._capacity.full), now_ns)

    def _merge(self, place: Place, entry: Entry, stored: Alert, now_ns: int) -> None:
        was, ours = entry.alert.unresolved, entry.alert
        taken = ours.revision > 0 and stored.gateway != entry.owner == ours.gateway
        if taken and place[0] not in self._grace:  # another gateway has the robot now
            self._believe(place, entry, stored)
            return
        entry.owner = stored.gateway
        self._by_id.pop(ours.id, None)
        entry.alert = merged(ours, stored)
        self._by_id[stored.id] = entry
        self._capacity.count(place, entry.alert.unresolved - was)
        if stored.unresolved and ours.id != stored.id:  # another gateway has told that it opened
            entry.news = ["changed"]
        elif was and not stored.unresolved:
            entry.news = ["changed"]
            if any(item.told_ns > stored.resolved_ns for item in entry.active.values()):
                entry.reopen(now_ns)
                self._capacity.count(place, 1)
        elif not was and not stored.unresolved and ours.resolved_ns != stored.resolved_ns:
            entry.alert = replace(stored, findings=ours.findings, clear_ns=ours.clear_ns)
            entry.news = ["seen"]  # somebody else has told that it is over

    def _believe(self, place: Place, entry: Entry, stored: Alert) -> None:
        """Nothing here is newer than what the store has."""
        was = entry.alert.unresolved
        self._by_id.pop(entry.alert.id, None)
        self._by_id[stored.id] = entry
        entry.alert, entry.owner, entry.news = stored, stored.gateway, []
        if stored.gateway != self._gateway:
            for key in entry.active:
                self._places.pop(key, None)
            entry.take_evidence(stored)
            self._claim(place, entry)
            if place[0] in self._grace:
                self._doubt(entry)
        self._capacity.count(place, stored.unresolved - was)

    def _doubt(self, entry: Entry) -> None:
        """What it groups was told to another gateway, or before a restart."""
        entry.unsure = {key for key in entry.active if not key[2].startswith("rule:")}  # rules tell nothing again
        entry.alert = replace(entry.alert, gateway=self._gateway)
        entry.note_change("seen")

    def _put(self, place: Place, alert: Alert) -> Entry:
        before = self._entries.get(place)
        if before is not None:
            self._drop(place, before)
        entry = Entry(alert, active=self._limits.alert_findings_active, shown=self._limits.alert_findings)
        self._entries[place] = self._by_id[alert.id] = entry
        self._causes[place[0]].add(place[1])
        self._capacity.count(place, int(alert.unresolved))
        return entry

    def _drop(self, place: Place, entry: Entry) -> None:
        for key in entry.active:
            self._places.pop(key, None)
        del self._entries[place]
        self._by_id.pop(entry.alert.id, None)
        self._capacity.count(place, -int(entry.alert.unresolved))
        self._causes[place[0]].discard(place[1])
        if not self._causes[place[0]]:
            del self._causes[place[0]]

    def _claim(self, place: Place, entry: Entry, *keys: Key) -> None:
        for key in keys or entry.active:
            if key in entry.active:
                self._places[key] = place
