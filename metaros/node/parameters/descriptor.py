"""What a parameter may be: its type, range, choices and who may set it."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, Final

from metaros.errors import ParameterError
from metaros.limits import LIMITS
from metaros.node.parameters.values import ParameterType, Value, fit, infer, kind_of

__all__ = ["ParameterDescriptor", "Range", "check_name"]

_STEP_TOLERANCE: Final = 1e-6  # of a step: doubles seldom hit one exactly; rclpy's figure
Validate = Callable[[Any], object]


@dataclass(frozen=True, slots=True)
class Range:
    """Bounds, both inclusive; with a `step` only `low`, `low + step`, … and `high` are allowed."""

    low: float
    high: float
    step: float = 0

    def fault(self, value: float) -> str:
        """Why the number is refused; empty when it is not."""
        if not self.low <= value <= self.high:
            return f"{value} is not within {self.low}..{self.high}"
        if not self.step or value in (self.low, self.high):
            return ""
        if isinstance(value, int) and isinstance(self.step, int) and isinstance(self.low, int):
            hit = (value - self.low) % self.step == 0
        else:
            steps = (value - self.low) / self.step
            hit = math.isclose(steps, round(steps), rel_tol=_STEP_TOLERANCE, abs_tol=_STEP_TOLERANCE)
        return "" if hit else f"{value} is no step of {self.step} from {self.low}"


@dataclass(frozen=True, slots=True, kw_only=True)
class ParameterDescriptor:
    """One parameter's rules. `kind` is NOT_SET only with `dynamic_typing`."""

    name: str
    kind: ParameterType = ParameterType.NOT_SET
    description: str = ""
    constraints: str = ""  # of a remote parameter: what its node says of them in words
    read_only: bool = False
    dynamic_typing: bool = False
    range: Range | None = None
    choices: tuple[Any, ...] = ()
    validate: Validate | None = None

    def __post_init__(self) -> None:
        """Refuse rules that contradict each other."""
        check_name(self.name)
        if self.range is not None:
            if self.kind not in _NUMBERS:
                raise ParameterError(f"{self.name}: only integer and double parameters have a range")
            parts = (self.range.low, self.range.high, self.range.step)
            if any(math.isnan(part) for part in parts) or self.range.low > self.range.high or self.range.step < 0:
                raise ParameterError(f"{self.name}: {parts[0]}..{parts[1]} by {parts[2]} is no range")
            if _NUMBERS[self.kind] is int and not all(isinstance(part, int) for part in parts):
                raise ParameterError(f"{self.name}: the range of an integer parameter is in integers")
        if self.kind is ParameterType.NOT_SET and not self.dynamic_typing:
            raise ParameterError(f"{self.name}: without a default value it needs a parameter_type, or dynamic_typing")
        for choice in self.choices:
            if not self.dynamic_typing:
                fit(choice, self.kind)

    def accept(self, value: object, *, exact: bool = False) -> Value:
        """The value as it would be kept; ParameterError says why it is refused. `exact` converts nothing."""
        plain = infer(value)
        if self.dynamic_typing:
            accepted = plain
        elif exact and kind_of(plain) is not self.kind and plain != []:
            raise ParameterError(f"wrong type: expected {self.kind.label}, got {kind_of(plain).label}")
        else:
            accepted = fit(plain, self.kind)
        self._check(accepted)
        return accepted

    def _check(self, value: Value) -> None:
        if self.range is not None and isinstance(value, int | float) and (fault := self.range.fault(value)):
            raise ParameterError(fault)
        if self.choices and value not in self.choices:
            raise ParameterError(f"{value!r} is none of {', '.join(map(repr, self.choices))}")
        if self.validate is None:
            return
        try:
            verdict = self.validate(value)
        except Exception as error:
            raise ParameterError(str(error) or type(error).__name__) from error
        if verdict is False or (isinstance(verdict, str) and verdict):
            raise ParameterError(verdict or f"{value!r} is not valid")

    @property
    def words(self) -> str:
        """The constraints that a ROS descriptor has no field for, as a person reads them."""
        if self.choices:
            return f"one of {', '.join(map(str, self.choices))}"
        return self.constraints


_NUMBERS: Final = {ParameterType.INTEGER: int, ParameterType.DOUBLE: float}


def check_name(name: object) -> str:
    """A parameter's name: any printable text of some length; dots group parameters."""
    if not isinstance(name, str) or not name or not name.isprintable():
        raise ParameterError(f"a parameter's name is printable text, not {name!r}")
    if len(name) > LIMITS.ros_name_chars:
        raise ParameterError(
            f"the name {name[:40]}… has {len(name)} characters, at most {LIMITS.ros_name_chars} are allowed"
        )
    return name
