"""What a health rule looks at: a measured number, when it is bad, when it is good again, and how to say so.

Between bad and good lies a band that is neither: a number that wavers about a threshold decides nothing.
"""

from __future__ import annotations

from dataclasses import KW_ONLY, dataclass
from typing import Literal, Protocol

__all__ = ["CallbackOverrun", "CpuPercent", "DeadlineMissed", "ErrorCount", "Signal", "Temperature", "TopicRate"]


class Signal(Protocol):
    """A measured number with two thresholds."""

    @property
    def key(self) -> str:
        """Under which name its reading comes."""

    def bad(self, value: float) -> bool:
        """Whether the reading speaks against the node's health."""

    def good(self, value: float) -> bool:
        """Whether it speaks for it."""

    def describe(self, value: float) -> str:
        """The reading as a clause, such as `/scan comes at 2.0 Hz (wanted: 5 Hz)`."""


@dataclass(frozen=True, slots=True)
class TopicRate:
    """A topic that the node subscribes to comes too seldom; good again from `clear_hz` (default: a quarter more)."""

    topic: str
    _: KW_ONLY
    below_hz: float
    clear_hz: float | None = None
    window_s: float = 2.0

    @property
    def key(self) -> str:
        """One reading a topic and window."""
        return f"rate {self.topic} {self.window_s:g} s"

    def bad(self, value: float) -> bool:
        """Below the threshold."""
        return value < self.below_hz

    def good(self, value: float) -> bool:
        """Clearly above it."""
        return value >= (self.below_hz * 1.25 if self.clear_hz is None else self.clear_hz)

    def describe(self, value: float) -> str:
        """The rate and the wanted one."""
        return f"{self.topic} comes at {value:.1f} Hz (wanted: {self.below_hz:g} Hz)"


@dataclass(frozen=True, slots=True)
class DeadlineMissed:
    """A topic was silent for longer than `deadline_s`, `at_least` times within the window; good when never."""

    topic: str
    _: KW_ONLY
    deadline_s: float
    at_least: int = 1
    window_s: float = 5.0

    @property
    def key(self) -> str:
        """One reading a topic, deadline and window."""
        return f"deadline {self.topic} {self.deadline_s:g} s in {self.window_s:g} s"

    def bad(self, value: float) -> bool:
        """As often as that."""
        return value >= self.at_least

    def good(self, value: float) -> bool:
        """Not once."""
        return value < 1

    def describe(self, value: float) -> str:
        """How often."""
        return f"{self.topic} missed its deadline of {self.deadline_s:g} s {value:.0f}× in {self.window_s:g} s"


@dataclass(frozen=True, slots=True)
class CallbackOverrun:
    """A callback took longer than `over_s` within the window; good when none took more than four fifths of that.

    `callback` is a topic, a service or the name of a timer's function; empty means any of the node's.
    """

    callback: str = ""
    _: KW_ONLY
    over_s: float
    window_s: float = 5.0

    @property
    def key(self) -> str:
        """One reading a callback and window."""
        return f"duration {self.callback or '*'} {self.window_s:g} s"

    def bad(self, value: float) -> bool:
        """Longer than allowed."""
        return value > self.over_s

    def good(self, value: float) -> bool:
        """Clearly shorter."""
        return value <= self.over_s * 0.8

    def describe(self, value: float) -> str:
        """The longest one."""
        return (
            f"{self.callback or 'a callback'} took up to {value * 1000:.0f} ms (allowed: {self.over_s * 1000:.0f} ms)"
        )


@dataclass(frozen=True, slots=True)
class ErrorCount:
    """`at_least` errors within the window: exceptions of callbacks, and calls of `count_error`; good when none."""

    _: KW_ONLY
    at_least: int
    window_s: float = 10.0

    @property
    def key(self) -> str:
        """One reading a window."""
        return f"errors {self.window_s:g} s"

    def bad(self, value: float) -> bool:
        """As many as that."""
        return value >= self.at_least

    def good(self, value: float) -> bool:
        """None."""
        return value < 1

    def describe(self, value: float) -> str:
        """How many."""
        return f"errors in {self.window_s:g} s: {value:.0f} (allowed: {self.at_least - 1})"


@dataclass(frozen=True, slots=True)
class CpuPercent:
    """This process, or the whole host, computes too much; good again at nine tenths. Needs psutil, or to be fed."""

    _: KW_ONLY
    above: float
    of: Literal["process", "host"] = "process"

    @property
    def key(self) -> str:
        """One reading for the process, one for the host."""
        return f"cpu {self.of}"

    def bad(self, value: float) -> bool:
        """Above the threshold."""
        return value > self.above

    def good(self, value: float) -> bool:
        """Clearly below it."""
        return value <= self.above * 0.9

    def describe(self, value: float) -> str:
        """The load."""
        return f"the {self.of} takes {value:.0f} % CPU (allowed: {self.above:g} %)"


@dataclass(frozen=True, slots=True)
class Temperature:
    """Something is too hot; good again `margin_c` below. Fed by the node: `feed("temperature motor", 71.5)`."""

    sensor: str
    _: KW_ONLY
    above_c: float
    margin_c: float = 5.0

    @property
    def key(self) -> str:
        """One reading a sensor."""
        return f"temperature {self.sensor}"

    def bad(self, value: float) -> bool:
        """Above the threshold."""
        return value > self.above_c

    def good(self, value: float) -> bool:
        """Below it by the margin."""
        return value <= self.above_c - self.margin_c

    def describe(self, value: float) -> str:
        """How hot."""
        return f"{self.sensor} is at {value:.1f} °C (allowed: {self.above_c:g} °C)"
