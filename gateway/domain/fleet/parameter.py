"""ROS parameters as JSON: values to and from rcl_interfaces' form, and what a descriptor forbids. Pure.

Whole numbers that a browser cannot count to travel as text, both ways.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from metaros.errors import ParameterError

__all__ = ["KINDS", "Bounds", "Rules", "plain", "rules_of", "wired"]

# Their numbers on the wire are their places here; then the field of rcl_interfaces/msg/ParameterValue.
KINDS: tuple[tuple[str, str], ...] = (
    ("not_set", ""),
    ("bool", "bool_value"),
    ("integer", "integer_value"),
    ("double", "double_value"),
    ("string", "string_value"),
    ("byte_array", "byte_array_value"),
    ("bool_array", "bool_array_value"),
    ("integer_array", "integer_array_value"),
    ("double_array", "double_array_value"),
    ("string_array", "string_array_value"),
)
_NUMBERS = {name: number for number, (name, _) in enumerate(KINDS)}
_EXACT = 1 << 53  # up to which a browser's numbers are exact
_INT64 = range(-(1 << 63), 1 << 63)
_STEP_TOLERANCE = 1e-6  # of a step: doubles seldom hit one exactly
_ODD = ("nan", "inf", "-inf")


@dataclass(frozen=True, slots=True)
class Bounds:
    """Both inclusive; with a `step` only `low`, `low + step`, … and `high`."""

    low: float
    high: float
    step: float

    def fault(self, value: float) -> str:
        """Why a number is not within them; "" where it is."""
        if not self.low <= value <= self.high:
            return f"{value} is not within {self.low}..{self.high}"
        if not self.step or value in (self.low, self.high):
            return ""
        steps = (value - self.low) / self.step
        hit = math.isclose(steps, round(steps), rel_tol=_STEP_TOLERANCE, abs_tol=_STEP_TOLERANCE)
        return "" if hit else f"{value} is no step of {self.step} from {self.low}"


@dataclass(frozen=True, slots=True, kw_only=True)
class Rules:
    """What a node says that one of its parameters may be."""

    name: str
    kind: str = "not_set"
    description: str = ""
    constraints: str = ""
    read_only: bool = False
    dynamic_typing: bool = False
    integer_range: Bounds | None = None
    floating_point_range: Bounds | None = None

    def fault(self, value: Any) -> str:
        """Why the node would not take a JSON value; "" where nothing known speaks against it."""
        if self.read_only:
            return "it is read-only"
        if value is None:
            return "" if self.dynamic_typing else "only what is dynamically typed can be taken away"
        try:
            wired(value, "not_set" if self.dynamic_typing else self.kind)
        except ParameterError as error:
            return str(error)
        bounds = self.integer_range or self.floating_point_range
        if bounds is None or isinstance(value, list | bool):
            return ""
        return bounds.fault(int(value) if self.kind == "integer" else float(value))


def rules_of(descriptor: Mapping[str, Any]) -> Rules:
    """A rcl_interfaces/msg/ParameterDescriptor, as JSON."""
    number = descriptor["type"]
    return Rules(
        name=descriptor["name"],
        kind=KINDS[number][0] if 0 <= number < len(KINDS) else "not_set",
        description=descriptor["description"],
        constraints=descriptor["additional_constraints"],
        read_only=descriptor["read_only"],
        dynamic_typing=descriptor["dynamic_typing"],
        integer_range=_bounds(descriptor["integer_range"]),
        floating_point_range=_bounds(descriptor["floating_point_range"]),
    )


def plain(value: Mapping[str, Any]) -> tuple[str, Any]:
    """The kind of a rcl_interfaces/msg/ParameterValue, and its value for a JSON document."""
    number = value["type"]
    if not 0 < number < len(KINDS):
        return "not_set", None
    kind, field = KINDS[number]
    found = value[field]
    return kind, [_countable(item) for item in found] if isinstance(found, list) else _countable(found)


def wired(value: Any, kind: str) -> dict[str, Any]:
    """A JSON value as a rcl_interfaces/msg/ParameterValue of that kind; of `not_set` as what it looks like.

    Raises ParameterError where it is none of that kind. None takes the parameter away.
    """
    if value is None:
        return {"type": 0}
    kind = _looks_like(value) if kind == "not_set" else kind
    fits = _list(value, kind) if kind.endswith("_array") else _scalar(value, kind)
    return {"type": _NUMBERS[kind], KINDS[_NUMBERS[kind]][1]: fits}


def _bounds(found: Any) -> Bounds | None:
    if not found:
        return None
    first = found[0]
    low, high, step = (first[key] if first[key] is not None else math.nan for key in ("from_value", "to_value", "step"))
    return None if math.isnan(low) or math.isnan(high) else Bounds(low, high, 0 if math.isnan(step) else step)


def _countable(value: Any) -> Any:
    return str(value) if type(value) is int and abs(value) > _EXACT else value


def _looks_like(value: Any) -> str:
    if not isinstance(value, list):
        return {bool: "bool", int: "integer", float: "double", str: "string"}.get(type(value), "object")
    kinds = {_looks_like(item) for item in value}
    if kinds == {"integer", "double"}:
        return "double_array"
    if not kinds:
        return "string_array"  # an empty list has no kind of its own
    if len(kinds) > 1 or not kinds <= {"bool", "integer", "double", "string"}:
        raise ParameterError("a list holds bools, numbers or texts, of one type")
    return f"{kinds.pop()}_array"


def _list(value: Any, kind: str) -> list[Any]:
    if not isinstance(value, list):
        raise ParameterError(f"wrong type: expected a list ({kind.replace('_', ' ')}), got {_looks_like(value)}")
    if kind == "byte_array":
        if not all(type(item) is int and 0 <= item < 256 for item in value):
            raise ParameterError("wrong type: expected bytes, numbers from 0 to 255")
        return value
    return [_scalar(item, kind.removesuffix("_array")) for item in value]


def _scalar(value: Any, kind: str) -> Any:
    """The value where it is of the kind. Only what loses nothing is converted."""
    if kind == "integer" and isinstance(value, str) and value.removeprefix("-").isdecimal() and len(value) <= 20:
        value = int(value)
    if kind == "integer" and type(value) is int:
        if value not in _INT64:
            raise ParameterError(f"{value} does not fit an integer of 64 bits")
        return value
    if kind == "double" and value in _ODD:
        return float(value)
    if kind == "double" and type(value) in (int, float):
        if type(value) is int and abs(value) > _EXACT:
            raise ParameterError(f"{value} cannot be a double without loss")
        return float(value)
    if kind == "bool" and type(value) is bool:
        return value
    if kind == "string" and isinstance(value, str):
        return value
    raise ParameterError(f"wrong type: expected {kind}, got {_looks_like(value).replace('_', ' ')}")
