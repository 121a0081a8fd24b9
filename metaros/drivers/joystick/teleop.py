"""Driving by a gamepad: speeds while the deadman button is held. Pure."""

from __future__ import annotations

from collections.abc import Sequence

__all__ = ["Teleop"]


class Teleop:
    """Nothing moves until the button is pressed; letting it go gives one zero."""

    def __init__(
        self, *, deadman: int, linear_axis: int, angular_axis: int, max_linear: float, max_angular: float
    ) -> None:
        self._deadman = deadman
        self._axes = (linear_axis, angular_axis)
        self._most = (max_linear, max_angular)
        self._driving = False

    def speeds(self, axes: Sequence[float], buttons: Sequence[int]) -> tuple[float, float] | None:
        """m/s and rad/s to send now; None: nothing is to be sent."""
        if not (self._deadman < len(buttons) and buttons[self._deadman]):
            return self.release()
        self._driving = True
        linear, angular = (
            (axes[axis] if axis < len(axes) else 0.0) * most for axis, most in zip(self._axes, self._most, strict=True)
        )
        return (linear, angular)

    def release(self) -> tuple[float, float] | None:
        """The button was let go, or the gamepad is gone: one zero where it drove."""
        driving, self._driving = self._driving, False
        return (0.0, 0.0) if driving else None
