"""A differential-drive base on a pty: answers ros_arduino_bridge's commands, and its wheels turn in real time."""

from __future__ import annotations

import math
import threading
from collections.abc import Callable
from types import TracebackType

from metaros.clock import SystemClock
from tests.support.devices.pty_device import PtyDevice

AUTO_STOP_S = 2.0


class BaseEmulator:
    """`x`, `y`, `yaw` are where it truly is; `targets` is what it was told last, in ticks a period."""

    def __init__(
        self, device: PtyDevice, *, wheel_radius: float, separation: float, ticks_per_turn: float, pid_rate: float
    ) -> None:
        self.device = device
        self.x = self.y = self.yaw = 0.0
        self.targets = (0, 0)
        self.commands: list[str] = []
        self.answers = True
        self.missing = 0  # so many answers are lost
        self.on_lost_counts: Callable[[], object] = lambda: None
        self.noise = b""
        self.offset = [0, 0]  # of the encoders: what they counted before
        self._ticks = [0.0, 0.0]
        self._tick_m = 2 * math.pi * wheel_radius / ticks_per_turn
        self._separation = separation
        self._pid_rate = pid_rate
        self._clock = SystemClock()
        self._moved_s = self._reported_s = self._clock.monotonic_s()
        self._text = b""
        self._stop = threading.Event()
        self._lock = threading.Lock()
        self._thread = threading.Thread(target=self._work, name="base emulator")

    def restart(self) -> None:
        """As its reset button does: it stands, and counts from zero."""
        with self._lock:
            self._move()
            self.targets, self._ticks, self.offset = (0, 0), [0.0, 0.0], [0, 0]

    def unplug(self) -> None:
        """The cable is out; the board goes on until its auto-stop."""
        with self._lock:
            self.device.unplug()

    def replug(self) -> None:
        """The cable is in again."""
        with self._lock:
            self._text = b""
            self.device.replug()

    def __enter__(self) -> BaseEmulator:
        self._thread.start()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._stop.set()
        self._thread.join(60)

    def _work(self) -> None:
        while not self._stop.wait(0.001):
            with self._lock:
                *lines, self._text = (self._text + self.device.read(0.0)).split(b"\r")
                self._move()  # after the question: no answer says where it was before
                for line in lines:
                    answer = self._answer(line.decode("ascii", "replace"))
                    if self.missing:
                        self.missing -= 1
                        if line == b"e":
                            self.on_lost_counts()
                    elif self.answers:
                        self.device.write(self.noise + answer + b"\r\n")

    def _answer(self, line: str) -> bytes:
        self.commands.append(line)
        del self.commands[:-1000]
        word, *numbers = line.split() or [""]
        if word == "e":
            left, right = (_int32(math.floor(t) + o) for t, o in zip(self._ticks, self.offset, strict=True))
            return b"%d %d" % (left, right)
        if word == "r":
            self._ticks, self.offset = [0.0, 0.0], [0, 0]
            return b"OK"
        if word == "m" and len(numbers) == 2:
            self.targets = (int(numbers[0]), int(numbers[1]))
            self._reported_s = self._clock.monotonic_s()
            return b"OK"
        return b"Invalid Command"

    def _move(self) -> None:
        now_s = self._clock.monotonic_s()
        step_s, self._moved_s = now_s - self._moved_s, now_s
        if now_s - self._reported_s > AUTO_STOP_S:
            self.targets = (0, 0)
        left, right = (target * self._pid_rate * step_s for target in self.targets)
        self._ticks[0] += left
        self._ticks[1] += right
        way, turn = (left + right) / 2 * self._tick_m, (right - left) * self._tick_m / self._separation
        self.x += way * math.cos(self.yaw + turn / 2)
        self.y += way * math.sin(self.yaw + turn / 2)
        self.yaw += turn


def _int32(value: int) -> int:
    return (value + 2**31) % 2**32 - 2**31
