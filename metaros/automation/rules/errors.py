"""The errors of rules' texts: where one is wrong, what is wrong there, and what would be right.

UsageError
└── RuleTextError
    ├── PatternError     pattern_invalid
    ├── WhenError        when_invalid
    └── ScheduleError    schedule_invalid
"""

from __future__ import annotations

from metaros.errors import UsageError

__all__ = ["PatternError", "RuleTextError", "ScheduleError", "WhenError"]


class RuleTextError(UsageError):
    """A part of a rule is refused; the message is `path: what is wrong`, the path as in `detail.state[1].numeric`."""

    code = "rule_invalid"

    def __init__(self, path: str, text: str) -> None:
        """`path` is "" where the part as a whole is meant."""
        super().__init__(f"{path}: {text}" if path else text)
        self.path = path
        self.text = text


class PatternError(RuleTextError):
    """An event pattern is refused."""

    code = "pattern_invalid"


class WhenError(RuleTextError):
    """A condition with a memory is refused."""

    code = "when_invalid"


class ScheduleError(RuleTextError):
    """A schedule's expression or time zone is refused."""

    code = "schedule_invalid"
