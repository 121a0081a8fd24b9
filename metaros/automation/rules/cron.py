"""Cron expressions as AWS has them: `minutes hours day-of-month month day-of-week year`, local time without a zone."""

from __future__ import annotations

import calendar
import re
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from datetime import date, datetime, time

from metaros.automation.rules.cron_field import DAYS, HOURS, MINUTES, MONTHS, WEEKDAYS, YEARS, read_number, read_values
from metaros.automation.rules.errors import ScheduleError

__all__ = ["Cron", "read_cron"]

CHARS = 256
DaysOf = Callable[[int, int], frozenset[int]]  # of a year and a month


@dataclass(frozen=True, slots=True)
class Cron:
    """What was read: sorted minutes and hours, months, years, and the rules that say the days of a month."""

    minutes: tuple[int, ...]
    hours: tuple[int, ...]
    months: frozenset[int]
    years: tuple[int, ...]
    days: tuple[DaysOf, ...]

    def after(self, moment: datetime) -> Iterator[datetime]:
        """All its times after a moment, both without a zone, to the end of its last year."""
        for day in self._days_from(moment.date()):
            for hour in self.hours:
                for minute in self.minutes:
                    found = datetime.combine(day, time(hour, minute))
                    if found > moment:
                        yield found

    def _days_from(self, first: date) -> Iterator[date]:
        for year in self.years:
            if year < first.year:
                continue
            for month in range(1, 13):
                if month in self.months and (year, month) >= (first.year, first.month):
                    days = frozenset[int]().union(*(rule(year, month) for rule in self.days))
                    yield from (found for day in sorted(days) if (found := date(year, month, day)) >= first)


def read_cron(text: str) -> Cron:
    """Six fields as AWS has them, or the five of Unix where only one of the two fields of days is not `*`.

    Raises:
        ScheduleError: which field is wrong, and what it may be.
    """
    parts = text.split()
    if len(text) > CHARS or len(parts) not in (5, 6):
        raise ScheduleError("cron", "has six fields: minutes hours day-of-month month day-of-week year")
    minutes, hours, day, month, weekday, year = [*parts, "*"] if len(parts) == 5 else parts
    if len(parts) == 5:
        day, weekday = _of_unix(day, weekday)
    elif (day == "?") == (weekday == "?"):
        raise ScheduleError("day-of-week", "exactly one of day-of-month and day-of-week is ?")
    return Cron(
        minutes=tuple(sorted(read_values(minutes, MINUTES))),
        hours=tuple(sorted(read_values(hours, HOURS))),
        months=read_values(month, MONTHS),
        years=tuple(sorted(read_values(year, YEARS))),
        days=tuple(_day(part) for part in day.split(",")) if weekday == "?" else _weekdays(weekday),
    )


def _of_unix(day: str, weekday: str) -> tuple[str, str]:
    """Unix's fields of days as AWS has them; days of the week count from 0 there, and 7 is Sunday too."""
    if weekday == "*":
        return day, "?"
    if day != "*":
        raise ScheduleError("day-of-week", "with five fields, one of day-of-month and day-of-week is *")
    if re.search(r"[^0-7A-Za-z,*/-]", weekday) or "/" in weekday:
        raise ScheduleError(
            "day-of-week", f"{weekday[:40]!r}: with five fields, days 0 to 7 or names, ranges and lists"
        )
    names = ("SUN", "MON", "TUE", "WED", "THU", "FRI", "SAT", "SUN")
    named = re.sub(r"(?<![A-Za-z0-9])[0-7](?![A-Za-z0-9])", lambda found: names[int(found[0])], weekday)
    return "?", named.replace("SUN-SUN", "*")


def _day(text: str) -> DaysOf:
    """Of one entry of day-of-month: `L` the last, `LW` the last weekday, `15W` the weekday nearest to the 15th."""
    if text == "L":
        return lambda year, month: frozenset({_length(year, month)})
    if text == "LW":
        return lambda year, month: frozenset({_workday(year, month, _length(year, month))})
    if text.endswith("W"):
        wanted = read_number(text[:-1], DAYS)
        return lambda year, month: (
            frozenset({_workday(year, month, wanted)}) if wanted <= _length(year, month) else frozenset()
        )
    values = read_values(text, DAYS)
    return lambda year, month: frozenset(value for value in values if value <= _length(year, month))


def _weekdays(text: str) -> tuple[DaysOf, ...]:
    return tuple(_weekday(part) for part in text.split(","))


def _weekday(text: str) -> DaysOf:
    """Of one entry of day-of-week: `L` Saturday, `6L` the last Friday, `3#2` the second Tuesday of the month."""
    name, hash_, number = text.partition("#")
    if hash_:
        if number not in ("1", "2", "3", "4", "5"):
            raise ScheduleError(WEEKDAYS.name, f"{text[:40]!r}: a month has a first to a fifth, as in 3#2")
        wanted, week = read_number(name, WEEKDAYS), int(number)
        return lambda year, month: frozenset(_all(year, month, wanted)[week - 1 : week])
    if text == "L":
        return lambda year, month: frozenset(_all(year, month, 7))
    if text.endswith("L"):
        last = read_number(text[:-1], WEEKDAYS)
        return lambda year, month: frozenset(_all(year, month, last)[-1:])
    values = read_values(text, WEEKDAYS)
    return lambda year, month: frozenset(day for value in values for day in _all(year, month, value))


def _length(year: int, month: int) -> int:
    return calendar.monthrange(year, month)[1]


def _all(year: int, month: int, weekday: int) -> list[int]:
    """The days of a month that are this day of the week, 1 for Sunday."""
    first = 1 + (weekday - 2 - calendar.monthrange(year, month)[0]) % 7
    return list(range(first, _length(year, month) + 1, 7))


def _workday(year: int, month: int, day: int) -> int:
    """The day from Monday to Friday that is nearest, in the same month."""
    weekday = calendar.weekday(year, month, day)
    if weekday == calendar.SATURDAY:
        return day - 1 if day > 1 else day + 2
    if weekday == calendar.SUNDAY:
        return day + 1 if day < _length(year, month) else day - 2
    return day
