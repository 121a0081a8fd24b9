"""Makes findings with names, bands and reasons of what detectors report for slots and topics."""

from __future__ import annotations

import math
from collections.abc import Mapping

import numpy as np

from gateway.alerting.anomaly import reasons
from gateway.alerting.anomaly.checks import Check, CheckTable
from gateway.alerting.anomaly.detectors.cells import Second
from gateway.alerting.anomaly.detectors.cohort import CohortVerdict
from gateway.alerting.anomaly.detectors.columns import Floats
from gateway.alerting.anomaly.detectors.flat import FlatVerdict
from gateway.alerting.anomaly.detectors.lasting import Change
from gateway.alerting.anomaly.detectors.novelties import NoveltyVerdict
from gateway.alerting.anomaly.detectors.presence import Silence
from gateway.alerting.anomaly.detectors.rates import RateVerdict
from gateway.alerting.anomaly.detectors.values import ValueChange
from gateway.alerting.anomaly.detectors.vector import VectorVerdict
from gateway.alerting.anomaly.facts import FactChange
from gateway.alerting.anomaly.open_findings import OpenFindings
from gateway.alerting.anomaly.registry import SeriesRegistry
from gateway.domain.finding import Finding

__all__ = ["FindingWriter", "score"]

_NAN = math.nan


def score(value: float, low: float, high: float) -> float:
    """0.5 at the edge of the band, rising towards 1 with the distance in widths of the band."""
    if not (math.isfinite(low) or math.isfinite(high)):
        return 1.0
    beyond = max(low - value if math.isfinite(low) else 0.0, value - high if math.isfinite(high) else 0.0, 0.0)
    width = high - low if math.isfinite(high - low) else abs(high if math.isfinite(high) else low)
    return 1.0 - 0.5 / (1.0 + beyond / max(width, 1e-12))


class FindingWriter:
    """Writes to `opened`; looks names up in the registry and severities in the table."""

    def __init__(self, registry: SeriesRegistry, opened: OpenFindings) -> None:
        self._registry = registry
        self._opened = opened

    def values(self, changes: list[ValueChange], at_s: float) -> None:
        """Thresholds and rates of change."""
        for change in changes:
            robot, series, _ = self._registry.names[change.slot]
            check = change.check
            low = check.low if check.low is not None else _NAN
            high = check.high if check.high is not None else _NAN
            reason = reasons.limit(check, change.value) if change.opened else ""
            since_s = at_s - check.for_s
            self._edge(check, robot, series, change.opened, change.value, low, high, reason, since_s, at_s)

    def flat(self, verdict: FlatVerdict, table: CheckTable, at_s: float) -> None:
        """Values that froze."""
        check = table.get("frozen")
        if check is None:
            return
        for n, slot in enumerate(verdict.slots.tolist()):
            robot, series, _ = self._registry.names[slot]
            run_s, allowed_s, value = float(verdict.run_s[n]), float(verdict.allowed_s[n]), float(verdict.value[n])
            reason = reasons.frozen(value, run_s, allowed_s)
            self._edge(check, robot, series, bool(verdict.opened[n]), value, _NAN, _NAN, reason, at_s - run_s, at_s)

    def silence(self, verdict: Silence, table: CheckTable, at_s: float) -> None:
        """Topics that fell silent."""
        check = table.get("silence")
        if check is None:
            return
        for n, topic in enumerate(verdict.topics.tolist()):
            robot, name = self._registry.topic_names[topic]
            quiet_s, deadline_s = float(verdict.quiet_s[n]), float(verdict.deadline_s[n])
            reason = reasons.silent(quiet_s, deadline_s)
            since_s = at_s - quiet_s
            self._edge(check, robot, name, bool(verdict.opened[n]), quiet_s, 0.0, deadline_s, reason, since_s, at_s)

    def rate(
        self, check_id: str, verdict: RateVerdict, names: Mapping[int, tuple[str, str]], table: CheckTable, at_s: float,
        *, source: str = "",
    ) -> None:  # fmt: skip
        """Topics that are too slow or too often; `names` are robot and name by row."""
        check = table.get(check_id)
        if check is None:
            return
        for n, row in enumerate(verdict.rows.tolist()):
            robot, name = names[row]
            now_hz, usual_hz = float(verdict.now_hz[n]), float(verdict.usual_hz[n])
            low = usual_hz * check.low if check.low is not None else _NAN
            high = usual_hz * check.high if check.high is not None else _NAN
            reason = reasons.rate(now_hz, usual_hz)
            opened, since_s = bool(verdict.opened[n]), at_s - check.for_s
            self._edge(check, robot, name, opened, now_hz, low, high, reason, since_s, at_s, source=source)

    def lasting(self, changes: list[Change], table: CheckTable, at_s: float) -> None:
        """Levels, drifts, vibrations, steps. A feature that closes is over on both of its sides."""
        for change in changes:
            robot, series, _ = self._registry.names[change.slot]
            source = change.feature.name
            if not change.opened:
                for kind in {change.feature.above, change.feature.below}:
                    self._opened.close((robot, series, kind), source, at_s=at_s)
                continue
            check = table.get(change.kind)
            if check is not None:
                reason = reasons.changed(change, change.value, change.low, change.high)
                self._edge(
                    check, robot, series, True, change.value, change.low, change.high, reason, at_s, at_s, source=source
                )

    def cohort(self, verdict: CohortVerdict, table: CheckTable, at_s: float) -> None:
        """The odd ones out."""
        check = table.get("cohort")
        if check is None:
            return
        for n, slot in enumerate(verdict.slots.tolist()):
            robot, series, _ = self._registry.names[slot]
            mean, median, usual = (float(x[n]) for x in (verdict.mean, verdict.median, verdict.usual))
            reason = reasons.cohort(mean, median, int(verdict.others[n]))
            band = (median - usual, median + usual)
            self._edge(check, robot, series, bool(verdict.opened[n]), mean, *band, reason, at_s, at_s)

    def novel(self, verdict: NoveltyVerdict, second: Second, low: Floats, high: Floats, table: CheckTable) -> None:
        """Values never seen, in which a series stays."""
        check = table.get("novelty")
        if check is None:
            return
        for n, place in enumerate(verdict.places.tolist()):
            robot, series, _ = self._registry.names[int(second.slots[place])]
            value, band = float(second.mean[place]), (float(low[place]), float(high[place]))
            reason = reasons.novel(value, *band)
            opened = bool(verdict.opened[n])
            self._edge(check, robot, series, opened, value, *band, reason, second.at_s, second.at_s)

    def together(self, robot: str, names: list[str], verdict: VectorVerdict, n: int, check: Check, at_s: float) -> None:
        """Metrics that do not fit together."""
        parts, distance, limit = verdict.parts[n], float(verdict.distance[n]), float(verdict.limit[n])
        order = np.argsort(-parts, kind="stable")[:3]
        total = max(float(np.maximum(parts, 0.0).sum()), 1e-12)
        blamed = [(names[place], float(parts[place]) / total) for place in order.tolist() if parts[place] > 0.0]
        reason = reasons.together(blamed, distance / max(limit, 1e-12))
        self._edge(check, robot, "", bool(verdict.opened[n]), distance, 0.0, limit, reason, at_s, at_s)

    def fact(self, change: FactChange, at_s: float) -> None:
        """What is no metric."""
        check = change.check
        high = check.high if check.high is not None else check.for_s
        reason = reasons.fact(check, change.where, change.value)
        self._edge(
            check, change.robot, change.where, change.opened, change.value, 0.0, high, reason, change.since_s, at_s
        )

    def _edge(
        self, check: Check, robot: str, series: str, opened: bool, value: float, low: float, high: float, reason: str,
        since_s: float, at_s: float, *, source: str = "",
    ) -> None:  # fmt: skip
        if not opened:
            self._opened.close((robot, series, check.id), source or check.id, at_s=at_s)
            return
        finding = Finding(
            robot=robot, series=series, kind=check.id, cause=check.cause, severity=check.severity,
            score=score(value, low, high), value=value, low=low, high=high, reason=reason, since_s=since_s,
        )  # fmt: skip
        self._opened.open(finding, source or check.id, at_s=at_s)
