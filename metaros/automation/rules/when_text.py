"""Conditions with a memory, as a rule says them: `{"for": "5s", "cooldown": "10m", "group_by": "robot"}`."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Any, Literal, get_args

from metaros.automation.rules.errors import WhenError
from metaros.automation.rules.fields import ROBOT, is_path
from metaros.automation.rules.numeric import is_number
from metaros.automation.rules.periods import read_period
from metaros.limits import LIMITS, Limits

__all__ = ["KEYS", "Debounce", "Edge", "Hysteresis", "Rate", "When"]

Edge = Literal["rising", "falling", "both"]


@dataclass(frozen=True, slots=True)
class Debounce:
    """Of what comes in a burst, its first or its last counts; it ends with `quiet_ns` of silence."""

    quiet_ns: int
    leading: bool = False


@dataclass(frozen=True, slots=True)
class Rate:
    """So many within so long."""

    count: int
    within_ns: int


@dataclass(frozen=True, slots=True)
class Hysteresis:
    """Begins where the value reaches `enter` and ends where it reaches `exit`; `above`: begins on its way up.

    `field` is the value's path in the event, "" where the caller has the value.
    """

    enter: float
    exit: float
    above: bool
    field: str = ""

    def level(self, before: bool, value: float | None) -> bool:
        """Whether it holds after this value, given whether it did before; without a value nothing changes."""
        if value is None or not is_number(value):
            return before
        if before and value != self.enter:
            return value > self.exit if self.above else value < self.exit
        return value >= self.enter if self.above else value <= self.enter


@dataclass(frozen=True, slots=True, kw_only=True)
class When:
    """What was read; without any of it every matching event acts. `document` is what it was read from."""

    for_ns: int | None = None
    debounce: Debounce | None = None
    cooldown_ns: int | None = None
    rate: Rate | None = None
    hysteresis: Hysteresis | None = None
    absent_for_ns: int | None = None
    edge: Edge | None = None
    group_by: tuple[str, ...] = (ROBOT,)
    document: Mapping[str, Any] = field(default_factory=dict, compare=False)

    @classmethod
    def parse(cls, document: Mapping[str, Any], *, limits: Limits = LIMITS) -> When:
        """Read them; WhenError names the key that is wrong, and the limit."""
        if not isinstance(document, Mapping):
            raise WhenError("", "is an object like {'for': '5s'}")
        read: dict[str, Any] = {}
        for name, value in document.items():
            if name not in KEYS:
                raise WhenError(str(name)[:40], f"there is no such condition; there are {', '.join(KEYS)}")
            key, reader = KEYS[name]
            read[key] = reader(value, name, limits)
        if "absent_for" in document and (beside := set(document) - {"absent_for", "cooldown", "group_by"}):
            raise WhenError("absent_for", f"goes with cooldown and group_by only, not with {', '.join(sorted(beside))}")
        if "for" in document or "hysteresis" in document:
            read.setdefault("edge", "rising")
        return cls(**read, document=dict(document))


def _object(value: Any, path: str, needed: set[str], more: set[str], example: str) -> Mapping[str, Any]:
    if not isinstance(value, Mapping) or not needed <= set(value) <= needed | more:
        raise WhenError(path, f"is an object like {example}")
    return value


def _period(value: Any, path: str, limits: Limits) -> int:
    return read_period(value, path, most_s=limits.rule_period_s)


def _debounce(value: Any, path: str, limits: Limits) -> Debounce:
    if not isinstance(value, Mapping):
        return Debounce(_period(value, path, limits))
    read = _object(value, path, {"quiet"}, {"fires"}, "{'quiet': '2s', 'fires': 'leading'}")
    fires = read.get("fires", "trailing")
    if fires not in ("leading", "trailing"):
        raise WhenError(f"{path}.fires", "is leading or trailing")
    return Debounce(_period(read["quiet"], f"{path}.quiet", limits), leading=fires == "leading")


def _rate(value: Any, path: str, limits: Limits) -> Rate:
    read = _object(value, path, {"count", "within"}, set(), "{'count': 5, 'within': '1m'}")
    count = read["count"]
    if type(count) is not int or not 2 <= count <= limits.rule_rate:
        raise WhenError(f"{path}.count", f"is a whole number from 2 to {limits.rule_rate} (rule_rate)")
    return Rate(count, _period(read["within"], f"{path}.within", limits))


def _hysteresis(value: Any, path: str, limits: Limits) -> Hysteresis:
    example = "{'enter': 20, 'exit': 25, 'field': 'detail.data.percentage'}"
    read = _object(value, path, {"enter", "exit"}, {"field", "direction"}, example)
    enter, leave, where = read["enter"], read["exit"], read.get("field", "")
    if not is_number(enter) or not is_number(leave):
        raise WhenError(path, f"enter and exit are numbers, as in {example}")
    if where != "" and not is_path(where):
        raise WhenError(f"{path}.field", "is the path of a field, as detail.data.percentage")
    direction = read.get("direction", "above" if enter > leave else "below" if enter < leave else None)
    if direction not in ("above", "below"):
        raise WhenError(f"{path}.direction", "is above or below; it must be said where enter and exit are equal")
    if (enter < leave and direction == "above") or (enter > leave and direction == "below"):
        raise WhenError(f"{path}.direction", f"a value that begins at {enter} and ends at {leave} goes the other way")
    return Hysteresis(enter, leave, direction == "above", where)


def _edge(value: Any, path: str, limits: Limits) -> Edge:
    if value not in get_args(Edge):
        raise WhenError(path, "is rising, falling or both")
    return value  # type: ignore[no-any-return]


def _group_by(value: Any, path: str, limits: Limits) -> tuple[str, ...]:
    paths = value if isinstance(value, list) else [value]
    if len(paths) > limits.rule_group_paths:
        raise WhenError(path, f"at most {limits.rule_group_paths} fields (rule_group_paths)")
    if not all(is_path(each) for each in paths):
        raise WhenError(path, "is robot, the path of a field like detail.joint, a list of them, or [] for one group")
    return tuple(paths)


KEYS: dict[str, tuple[str, Callable[[Any, str, Limits], Any]]] = {
    "for": ("for_ns", _period),
    "debounce": ("debounce", _debounce),
    "cooldown": ("cooldown_ns", _period),
    "rate": ("rate", _rate),
    "hysteresis": ("hysteresis", _hysteresis),
    "absent_for": ("absent_for_ns", _period),
    "edge": ("edge", _edge),
    "group_by": ("group_by", _group_by),
}
