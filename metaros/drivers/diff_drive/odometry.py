"""Encoder counts to a pose: wraps are followed, jumps (the board began anew, a line was damaged) are not. Pure."""

from __future__ import annotations

from metaros.drivers.diff_drive.kinematics import Pose, Wheels, moved, wrapped

__all__ = ["Odometer"]


class Odometer:
    """Feed counts; read `pose`, `linear`, `angular`, `angles` and `rates` of the wheels."""

    def __init__(self, wheels: Wheels, *, max_ticks_s: float) -> None:
        """`max_ticks_s`: what no wheel exceeds; more in one step is a jump."""
        self._wheels = wheels
        self._max_ticks_s = max_ticks_s
        self._counts: tuple[int, int] | None = None
        self._asked_s = self._received_s = 0.0
        self.pose = Pose()
        self.linear = self.angular = 0.0
        self.angles = (0.0, 0.0)
        self.rates = (0.0, 0.0)

    def begin(self) -> None:
        """The next counts are where it stands: the board was away."""
        self._counts = None
        self.linear = self.angular = 0.0
        self.rates = (0.0, 0.0)

    def feed(self, counts: tuple[int, int], now_s: float, *, error: float, asked_s: float | None = None) -> bool:
        """One reading, of some moment between `asked_s` (else `now_s`) and `now_s`; False where it was a jump, and the
        place stays.
        """
        asked_s = now_s if asked_s is None else asked_s
        last, self._counts = self._counts, counts
        longest_s, step_s = now_s - self._asked_s, (asked_s + now_s - self._asked_s - self._received_s) / 2
        self._asked_s, self._received_s = asked_s, now_s
        if last is None or step_s <= 0:
            return True
        left, right = wrapped(counts[0] - last[0]), wrapped(counts[1] - last[1])
        # Half a tenth of a second more: the answer may be that to a question before, which was late.
        if max(abs(left), abs(right)) > self._max_ticks_s * (longest_s + 0.05) + 2:
            self.linear = self.angular = 0.0
            self.rates = (0.0, 0.0)
            return False
        way_m, turn = self._wheels.way(left, right)
        self.pose = moved(self.pose, way_m, turn, error=error)
        self.linear, self.angular = way_m / step_s, turn / step_s
        turned = (
            self._wheels.left_sign * left * self._wheels.tick_rad,
            self._wheels.right_sign * right * self._wheels.tick_rad,
        )
        self.angles = (self.angles[0] + turned[0], self.angles[1] + turned[1])
        self.rates = (turned[0] / step_s, turned[1] / step_s)
        return True
