"""One field of a cron expression: values, ranges, lists and steps, by number or by name."""

from __future__ import annotations

from dataclasses import dataclass, field

from metaros.automation.rules.errors import ScheduleError

__all__ = ["DAYS", "HOURS", "MINUTES", "MONTHS", "WEEKDAYS", "YEARS", "FieldRow", "read_number", "read_values"]

_MONTHS = ("JAN", "FEB", "MAR", "APR", "MAY", "JUN", "JUL", "AUG", "SEP", "OCT", "NOV", "DEC")
_DAYS = ("SUN", "MON", "TUE", "WED", "THU", "FRI", "SAT")


@dataclass(frozen=True, slots=True)
class FieldRow:
    """What a field may hold; `round` is whether a range may go over its end, as `FRI-MON` and `22-2` do."""

    name: str
    least: int
    most: int
    names: dict[str, int] = field(default_factory=dict)
    round: bool = True


MINUTES = FieldRow("minutes", 0, 59)
HOURS = FieldRow("hours", 0, 23)
DAYS = FieldRow("day-of-month", 1, 31, round=False)
MONTHS = FieldRow("month", 1, 12, {name: number for number, name in enumerate(_MONTHS, 1)})
WEEKDAYS = FieldRow("day-of-week", 1, 7, {name: number for number, name in enumerate(_DAYS, 1)})
YEARS = FieldRow("year", 1970, 2199, round=False)


def read_values(text: str, row: FieldRow) -> frozenset[int]:
    """All values that a list names, as `1,5-10,*/15`; ScheduleError names the field."""
    return frozenset(value for part in text.split(",") for value in _part(part, row))


def _part(text: str, row: FieldRow) -> range | list[int]:
    span, slash, step_text = text.partition("/")
    step = 1
    if slash:
        if not step_text.isdecimal() or len(step_text) > 4 or not 0 < int(step_text) <= row.most:
            raise ScheduleError(row.name, f"{text!r}: a step is a whole number from 1 to {row.most}")
        step = int(step_text)
    if span == "*":
        return range(row.least, row.most + 1, step)
    first_text, dash, last_text = span.partition("-")
    first = read_number(first_text, row)
    if not dash:
        return range(first, row.most + 1, step) if slash else [first]
    last = read_number(last_text, row)
    if first <= last:
        return range(first, last + 1, step)
    if not row.round:
        raise ScheduleError(row.name, f"{span!r} goes backwards")
    size = row.most - row.least + 1
    return [(value - row.least) % size + row.least for value in range(first, last + size + 1, step)]


def read_number(text: str, row: FieldRow) -> int:
    """One value, by its number or name."""
    if (named := row.names.get(text.upper())) is not None:
        return named
    if text.isascii() and text.isdecimal() and len(text) <= 4 and row.least <= int(text) <= row.most:
        return int(text)
    names = f", or {' '.join(row.names)}" if row.names else ""
    raise ScheduleError(row.name, f"{text[:40]!r} is none of {row.least} to {row.most}{names}")
