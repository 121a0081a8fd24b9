"""The queue of one route: which notices are due, which failed and are tried again, and its counters. Pure."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import replace

from gateway.alerting.alerts.notices.document import Notice, Stage
from gateway.alerting.alerts.notices.plan import LastNotice, next_stage
from gateway.alerting.alerts.notices.route import Delivery, Route, RouteState
from gateway.domain.alert import Alert
from metaros.limits import Limits

__all__ = ["RouteQueue"]

S = 10**9
BACK_OFF_S = 1.0
LONGEST_S = 300.0


class RouteQueue:
    """What `due` names is sent by the caller, who says with `sent` or `failed` how that went."""

    def __init__(self, route: Route, *, limits: Limits) -> None:
        self.route = route
        self.state = RouteState(
            name=route.name,
            kind=route.kind,
            target=route.to.target,
            severity=route.severity,
            robots=route.robots,
            causes=route.causes,
        )
        self.unkept: dict[str, LastNotice] = {}  # what the store does not know yet
        self._limits = limits
        self._reported: dict[str, LastNotice] = {}
        self._next: dict[str, tuple[int, int]] = {}  # of an alert: at which revision it was looked at, when it is due
        self._owed: dict[str, tuple[Alert, int]] = {}  # what could not be told, and since when
        self._failures = 0
        self._not_before_s = 0.0

    def restore(self, told: Iterable[LastNotice], alerts: Iterable[Alert], now_ns: int) -> None:
        """What the store says was told; the alerts are those that were over before that was told."""
        self._reported = {item.alert: item for item in told}
        self._next.clear()
        open_ones = {item.alert for item in self._reported.values() if item.stage != "resolved"}
        self._owed = {alert.id: (alert, now_ns) for alert in alerts if alert.id in open_ones}

    def due(self, alerts: Sequence[Alert], now_ns: int, now_s: float) -> list[Notice]:
        """What is to be told now, the oldest alert first; nothing for a while after a failure."""
        found: dict[str, Notice] = {}
        for alert in alerts:
            looked = self._next.get(alert.id)
            if alert.revision and (looked is None or looked[0] != alert.revision or looked[1] <= now_ns):
                self._look_at(alert, now_ns, found)
        if self._owed:
            known = {alert.id for alert in alerts}
            for alert, _ in [item for key, item in self._owed.items() if key not in known]:
                self._look_at(alert, now_ns, found)
        self._forget(alerts)
        self.state = replace(self.state, waiting=len(found))
        if now_s < self._not_before_s:
            return []
        return sorted(found.values(), key=lambda notice: notice.alert.id)

    def sent(self, notices: Sequence[Notice], now_ns: int) -> None:
        """They arrived."""
        self._failures, self._not_before_s = 0, 0.0
        state = self.state
        waiting = max(0, state.waiting - len(notices))
        self.state = replace(state, sent=state.sent + len(notices), waiting=waiting, last_ns=now_ns, last_error="")
        self._settle(notices, now_ns)

    def failed(self, notices: Sequence[Notice], done: Delivery, now_ns: int, now_s: float) -> int:
        """They did not arrive: they are tried again, more and more seldom; how many are given up at last."""
        self._not_before_s = now_s + min(LONGEST_S, BACK_OFF_S * 2**self._failures)
        self._failures = min(self._failures + 1, 20)
        self.state = replace(self.state, failed=self.state.failed + 1, last_error=done.error)
        given_up = []
        for notice in notices:
            since_ns = self._owed.get(notice.alert.id, (notice.alert, now_ns))[1]
            self._owed[notice.alert.id] = (notice.alert, since_ns)
            if now_ns - since_ns > self._limits.notice_tries_s * S:
                given_up.append(notice)
        for alert, _ in list(self._owed.values())[: max(0, len(self._owed) - self._limits.notices_waiting)]:
            given_up.append(Notice(alert, "resolved" if not alert.unresolved else "opened"))
        self._settle(given_up, now_ns)
        return len(given_up)

    def _look_at(self, alert: Alert, now_ns: int, found: dict[str, Notice]) -> None:
        stage, due_ns = self._stage_of(alert)
        self._next[alert.id] = (alert.revision, due_ns)
        if alert.id in self._owed:
            self._owed[alert.id] = (alert, self._owed[alert.id][1])
        if due_ns <= now_ns:
            told = self._reported.get(alert.id)
            found[alert.id] = Notice(alert, stage, told.told_ns if told is not None else 0)

    def _stage_of(self, alert: Alert) -> tuple[Stage, int]:
        told = self._reported.get(alert.id)
        if told is None and alert.id in self._owed:
            return "opened", 0  # it is to be told also when it is over by now
        return next_stage(alert, told, self.route)

    def _settle(self, notices: Sequence[Notice], now_ns: int) -> None:
        for notice in notices:
            alert = notice.alert
            told = LastNotice(
                alert=alert.id,
                route=self.route.name,
                stage=notice.stage,
                severity=alert.severity,
                times=alert.times,
                told_ns=now_ns,
            )
            self._reported[alert.id] = self.unkept[alert.id] = told
            self._next.pop(alert.id, None)
            if notice.stage == "resolved" or alert.unresolved:  # else that it is over is to be told, too
                self._owed.pop(alert.id, None)

    def _forget(self, alerts: Sequence[Alert]) -> None:
        """What is over for good needs no memory; now and then, as it takes a look at all."""
        if len(self._next) + len(self._reported) > 3 * len(alerts) + 1000:
            known = {alert.id for alert in alerts} | self._owed.keys()
            self._next = {key: item for key, item in self._next.items() if key in known}
            self._reported = {key: item for key, item in self._reported.items() if key in known}
