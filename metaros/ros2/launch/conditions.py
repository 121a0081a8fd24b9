"""Conditions of actions."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, Final

from metaros.ros2.launch.substitution import SomeSubstitutionsType, perform_substitutions

__all__ = [
    "Condition",
    "IfCondition",
    "InvalidConditionExpressionError",
    "LaunchConfigurationEquals",
    "LaunchConfigurationNotEquals",
    "UnlessCondition",
    "evaluate_condition_expression",
]

_WORDS: Final = {
    "true": True,
    "1": True,
    "yes": True,
    "on": True,
    "false": False,
    "0": False,
    "no": False,
    "off": False,
}


class InvalidConditionExpressionError(Exception):
    """A text that is neither true nor false."""


def evaluate_condition_expression(context: Any, expression: SomeSubstitutionsType) -> bool:
    """`true` or `1`, `false` or `0`, in any case."""
    text = perform_substitutions(context, expression).strip()
    found = _WORDS.get(text.lower())
    if found is None:
        raise InvalidConditionExpressionError(f"{text!r} is no condition: it must be true, 1, false or 0")
    return found


class Condition:
    """Asks `predicate(context)`."""

    def __init__(self, *, predicate: Callable[[Any], bool] | None = None) -> None:
        self._predicate = predicate

    def evaluate(self, context: Any) -> bool:
        """Whether it holds."""
        return self._predicate is not None and bool(self._predicate(context))


class IfCondition(Condition):
    """Holds where the expression is true."""

    def __init__(self, predicate_expression: SomeSubstitutionsType) -> None:
        super().__init__(predicate=lambda context: evaluate_condition_expression(context, predicate_expression))


class UnlessCondition(Condition):
    """Holds where it is false."""

    def __init__(self, predicate_expression: SomeSubstitutionsType) -> None:
        super().__init__(predicate=lambda context: not evaluate_condition_expression(context, predicate_expression))


class LaunchConfigurationEquals(Condition):
    """Holds where a configuration has this text; with None, where there is none of that name."""

    def __init__(self, launch_configuration_name: str, expected_value: SomeSubstitutionsType | None) -> None:
        super().__init__(predicate=lambda context: _equals(context, launch_configuration_name, expected_value))


class LaunchConfigurationNotEquals(Condition):
    """Holds where it has not."""

    def __init__(self, launch_configuration_name: str, expected_value: SomeSubstitutionsType | None) -> None:
        super().__init__(predicate=lambda context: not _equals(context, launch_configuration_name, expected_value))


def _equals(context: Any, name: str, expected: SomeSubstitutionsType | None) -> bool:
    found = context.launch_configurations.get(name)
    return bool(found == (None if expected is None else perform_substitutions(context, expected)))
