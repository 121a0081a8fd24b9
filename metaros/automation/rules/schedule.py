"""When a rule acts without any event: `cron(0 9 ? * MON-FRI *)`, `rate(5 minutes)`, `at(2026-12-24T18:00:00)`.

Cron and `at` are times of a zone. A time that its clock leaps over does not come; one that comes twice counts the
first time. So does EventBridge Scheduler. `rate` counts hours of 60 minutes and days of 24 hours, whatever clocks do.
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import dataclass
from datetime import UTC, datetime, timedelta, tzinfo
from zoneinfo import ZoneInfo, ZoneInfoNotFoundError

from metaros.automation.rules.cron import Cron, read_cron
from metaros.automation.rules.errors import ScheduleError

__all__ = ["Schedule"]

NS_PER_S = 1_000_000_000
LAST_NS = 7_258_118_400 * NS_PER_S  # 2200: AWS's last year is over
_UNITS_S = {"minute": 60, "hour": 3600, "day": 86_400}
_EPOCH = datetime(1970, 1, 1, tzinfo=UTC)
_CALL = re.compile(r"(cron|rate|at)\((.*)\)", re.DOTALL)
_RATE = re.compile(r"([1-9]\d{0,5}) +(minute|hour|day)(s?)")
_AT = re.compile(r"\d{4}-\d\d-\d\dT\d\d:\d\d:\d\d")


@dataclass(frozen=True, slots=True)
class Schedule:
    """What was read: exactly one of `cron`, `every_ns` from `start_ns` on, and `at_ns`."""

    text: str
    zone: tzinfo
    cron: Cron | None = None
    every_ns: int = 0
    start_ns: int = 0
    at_ns: int = 0

    @classmethod
    def parse(cls, text: str, timezone: str = "UTC", *, start_ns: int = 0) -> Schedule:
        """Read an expression, or Unix's five fields of cron; `start_ns` is when the first period of a rate begins.

        Raises:
            ScheduleError: which part is wrong, and what it may be.
        """
        zone, words = _zone(timezone), text.strip()
        if len(words.split()) == 5 and "(" not in words:
            return cls(text, zone, cron=read_cron(words))
        call = _CALL.fullmatch(words)
        if call is None:
            raise ScheduleError("", "is cron(0 9 ? * MON-FRI *), rate(5 minutes) or at(2026-12-24T18:00:00)")
        name, inner = call[1], call[2].strip()
        if name == "cron":
            return cls(text, zone, cron=read_cron(inner))
        if name == "rate":
            return cls(text, zone, every_ns=_every_s(inner) * NS_PER_S, start_ns=start_ns)
        return cls(text, zone, at_ns=_at_ns(inner, zone))

    def next_after(self, t_ns: int) -> int | None:
        """The first time later than `t_ns`, ns since the epoch; None if none comes."""
        if t_ns >= LAST_NS:
            return None
        if self.every_ns:
            periods = max(1, (t_ns - self.start_ns) // self.every_ns + 1)
            return self.start_ns + periods * self.every_ns
        if self.cron is None:
            return self.at_ns if self.at_ns > t_ns else None
        after = _EPOCH + timedelta(seconds=max(t_ns, 0) // NS_PER_S)
        local = after.astimezone(self.zone).replace(tzinfo=None, fold=0)
        return next(self._times(self.cron.after(local), t_ns), None)

    def _times(self, moments: Iterator[datetime], t_ns: int) -> Iterator[int]:
        for moment in moments:
            found_ns = _moment_ns(moment, self.zone)
            if found_ns is not None and found_ns > t_ns:
                yield found_ns


def _zone(name: str) -> tzinfo:
    if name == "UTC":
        return UTC
    try:
        return ZoneInfo(name)
    except (ZoneInfoNotFoundError, ValueError, OSError):
        raise ScheduleError("timezone", f"{name[:60]!r} is no time zone like Europe/Paris") from None


def _moment_ns(moment: datetime, zone: tzinfo) -> int | None:
    """When a zone's clock shows a time, the first time that it does; None if it leaps over it."""
    when = moment.replace(tzinfo=zone, fold=0).astimezone(UTC)
    if when.astimezone(zone).replace(tzinfo=None, fold=0) != moment:
        return None
    return (when - _EPOCH) // timedelta(seconds=1) * NS_PER_S


def _every_s(text: str) -> int:
    read = _RATE.fullmatch(text)
    if read is None or (read[1] == "1") == bool(read[3]):
        raise ScheduleError("rate", f"{text[:40]!r} is not like 1 minute, 5 minutes, 12 hours or 1 day")
    return int(read[1]) * _UNITS_S[read[2]]


def _at_ns(text: str, zone: tzinfo) -> int:
    try:
        moment = datetime.fromisoformat(text) if _AT.fullmatch(text) else None
    except ValueError:
        moment = None
    if moment is None or not 1970 <= moment.year <= 2199:
        raise ScheduleError("at", f"{text[:40]!r} is no time like 2026-12-24T18:00:00")
    found_ns = _moment_ns(moment, zone)
    if found_ns is None:
        raise ScheduleError("at", f"{text}: the clocks of {zone} leap over this time")
    return found_ns
