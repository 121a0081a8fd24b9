"""Which axes and buttons a gamepad has, and their state as Joy has it. Pure.

Axes and buttons stand in Joy in the order of their codes in input-event-codes.h, as in ROS's joy_linux.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Final

from metaros.drivers.joystick.events import DROPPED, EV_ABS, EV_KEY, EV_SYN, REPORT, InputEvent

__all__ = ["STANDARD", "AxisRange", "Layout", "PadState"]

_ABS_HAT0X: Final = 0x10
_BTN_SOUTH: Final = 0x130
MAX_AXES: Final = 32
MAX_BUTTONS: Final = 64


@dataclass(frozen=True, slots=True)
class AxisRange:
    """What the kernel says of an axis (struct input_absinfo)."""

    minimum: int
    maximum: int
    value: int = 0

    def scaled(self, value: int, deadzone: float) -> float:
        """-1 to 1; left and up, which the kernel has as the smaller values, are positive, as ROS has it."""
        width = self.maximum - self.minimum
        if width <= 0:
            return 0.0
        part = 1 - 2 * (min(max(value, self.minimum), self.maximum) - self.minimum) / width
        over = max(0.0, abs(part) - deadzone) / (1 - deadzone)
        return over if part > 0 else -over if over else 0.0


@dataclass(frozen=True, slots=True)
class Layout:
    """Axes by their codes, and the buttons' codes."""

    name: str
    axes: Mapping[int, AxisRange]
    buttons: tuple[int, ...]


# As xpad and most others have it; for what is no input device (a pipe in a test, a recording).
STANDARD: Final = Layout(
    "standard gamepad",
    {code: AxisRange(-32768, 32767) for code in range(6)} | {_ABS_HAT0X + at: AxisRange(-1, 1) for at in range(2)},
    tuple(code for code in range(_BTN_SOUTH, _BTN_SOUTH + 15) if code not in (_BTN_SOUTH + 2, _BTN_SOUTH + 5)),
)


@dataclass(slots=True)
class PadState:
    """The state, from events. No button begins as pressed: one held while the pad comes must be pressed anew."""

    layout: Layout
    values: dict[int, int] = field(default_factory=dict)
    pressed: set[int] = field(default_factory=set)
    _dropping: bool = False

    def __post_init__(self) -> None:
        self.values = {code: axis.value for code, axis in self.layout.axes.items()}

    def take(self, event: InputEvent) -> bool:
        """One event; whether the state is to be told: a group is complete. Where the kernel dropped events, nothing is
        pressed and nothing moved, and what follows up to the end of that group is left.
        """
        if event.type == EV_SYN:
            dropped, self._dropping = self._dropping, self._dropping and event.code != REPORT
            if event.code == DROPPED:
                self._dropping = True
                self.pressed.clear()
                self.values = {code: (axis.minimum + axis.maximum) // 2 for code, axis in self.layout.axes.items()}
            return event.code == DROPPED or (event.code == REPORT and not dropped)
        if self._dropping:
            return False
        if event.type == EV_ABS and event.code in self.values:
            self.values[event.code] = event.value
        elif event.type == EV_KEY and event.code in self.layout.buttons:
            if event.value == 1:
                self.pressed.add(event.code)
            elif event.value == 0:  # 2 is a repetition of what is held
                self.pressed.discard(event.code)
        return False

    def axes(self, deadzone: float) -> list[float]:
        """As Joy has them."""
        return [axis.scaled(self.values[code], deadzone) for code, axis in sorted(self.layout.axes.items())[:MAX_AXES]]

    def buttons(self) -> list[int]:
        """As Joy has them."""
        return [int(code in self.pressed) for code in self.layout.buttons[:MAX_BUTTONS]]
