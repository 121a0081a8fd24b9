"""Which of the messages of one line of a program are shown: all, the first alone, all but the first, one in so long.

A filter is asked for by arguments of the call. They are looked at in the order `throttle`, `skip_first`, `once`; one
that says no keeps the later ones from seeing the message.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any, Final

from metaros.ros2.rclpy.time.clock import Clock

__all__ = ["Filters", "wanted_filters"]

_PARAMETERS: Final[dict[str, tuple[str, ...]]] = {
    "throttle": ("throttle_duration_sec", "throttle_time_source_type"),
    "skip_first": ("skip_first",),
    "once": ("once",),
}
_OPTIONAL: Final = "throttle_time_source_type"
_KNOWN: Final = tuple(name for names in _PARAMETERS.values() for name in names)
_ANY_CLOCK: Final = Clock()  # the system's, where a call names none


def wanted_filters(arguments: Mapping[str, Any]) -> tuple[str, ...]:
    """The filters that the arguments of a call ask for; TypeError where one is unknown, or lacks its companion."""
    for name in arguments:
        if name not in _KNOWN:
            text = f"parameter {name!r} is not one of the recognized logging options: {', '.join(_KNOWN)}"
            raise TypeError(text)
    wanted = tuple(kind for kind, names in _PARAMETERS.items() if any(arguments.get(name) for name in names))
    for kind in wanted:
        for name in _PARAMETERS[kind]:
            if name not in arguments and name != _OPTIONAL:
                raise TypeError(f"required parameter {name!r} not specified, the filter {kind!r} needs it")
    return wanted


class Filters:
    """The filters of one line. What it was first called with stays: a line may not change its mind.

    Raises:
        TypeError: an argument that a filter needs is None.
        ValueError: the time source is no clock.
    """

    def __init__(self, name: str, severity: int, wanted: tuple[str, ...], arguments: Mapping[str, Any]) -> None:
        self._name = name
        self._severity = severity
        self._wanted = wanted
        self._arguments = _of(wanted, arguments)
        for argument, value in self._arguments.items():
            if value is None:
                raise TypeError(f"Required parameter {argument!r} was not specified for a logging filter")
        self._clock = self._arguments.get("throttle_time_source_type", _ANY_CLOCK)
        if not isinstance(self._clock, Clock):
            raise ValueError(f"throttle_time_source_type is {self._clock!r}, which is not a clock instance")
        self._last_ns = 0
        self._skipped = self._said = False
        self._checks: tuple[Callable[[], bool], ...] = tuple(getattr(self, f"_{kind}") for kind in wanted)

    def check_same(self, name: str, severity: int, wanted: tuple[str, ...], arguments: Mapping[str, Any]) -> None:
        """ValueError where the line asks for something else than the first time."""
        if severity != self._severity:
            raise ValueError("Logger severity cannot be changed between calls.")
        if name != self._name:
            raise ValueError("Logger name cannot be changed between calls.")
        if wanted != self._wanted:
            raise ValueError("Requested logging filters cannot be changed between calls.")
        if wanted and _of(wanted, arguments) != self._arguments:
            raise ValueError("Logging filter parameters cannot be changed between calls.")

    def pass_on(self) -> bool:
        """Whether this message is shown; the filters take note of it."""
        return all(check() for check in self._checks)

    def _throttle(self) -> bool:
        now_ns = self._clock.now().nanoseconds
        if now_ns < self._last_ns + self._arguments["throttle_duration_sec"] * 1e9:
            return False
        self._last_ns = now_ns
        return True

    def _skip_first(self) -> bool:
        skipped, self._skipped = self._skipped, True
        return skipped

    def _once(self) -> bool:
        said, self._said = self._said, True
        return not said


def _of(wanted: tuple[str, ...], arguments: Mapping[str, Any]) -> dict[str, Any]:
    """The arguments that these filters read, with the clock they go by."""
    return {
        name: arguments.get(name, _ANY_CLOCK if name == _OPTIONAL else None)
        for kind in wanted
        for name in _PARAMETERS[kind]
    }
