"""Mixes what is to be played by priority: live speech (talk) before streams before clips. Pure, and thread-safe."""

from __future__ import annotations

import threading
from collections import Counter, deque
from typing import Final

import numpy as np
import numpy.typing as npt

__all__ = ["CLIPS", "JitterBuffer", "Mixer", "Sound"]

Sound = npt.NDArray[np.float32]
START_S: Final = 0.06  # gathered before a stream begins
MOST_S: Final = 0.3  # more than so much waits: the oldest is skipped, latest wins
CLIPS: Final = 8
_NOTHING: Final = np.zeros(0, np.float32)


class JitterBuffer:
    """Evens out a stream: begins when START_S are there, is never more than MOST_S behind."""

    def __init__(self, rate: int) -> None:
        self._start, self._most = round(rate * START_S), round(rate * MOST_S)
        self._waiting = _NOTHING
        self._playing = False

    def push(self, sound: Sound) -> int:
        """Add to its end; how many samples were skipped for it."""
        waiting = np.concatenate((self._waiting, sound))
        skipped = 0
        if len(waiting) > self._most:
            skipped = len(waiting) - self._start
            waiting = waiting[skipped:]
        self._waiting = waiting
        return skipped

    def take(self, count: int) -> Sound | None:
        """The next samples, at most so many; None while it gathers."""
        if not self._playing and len(self._waiting) < self._start:
            return None
        taken, self._waiting = self._waiting[:count], self._waiting[count:]
        self._playing = len(taken) == count
        return taken if len(taken) else None

    def clear(self) -> None:
        """Be silent, and gather anew."""
        self._waiting, self._playing = _NOTHING, False


class Mixer:
    """Talk, a stream, and a queue of clips; `counters` tell what was not played."""

    def __init__(self, rate: int) -> None:
        self._lock = threading.Lock()
        self._talk = JitterBuffer(rate)
        self._stream = JitterBuffer(rate)
        self._clips: deque[Sound] = deque()
        self._rate = rate
        self.counters: Counter[str] = Counter()
        self.playing = "nothing"

    def talk(self, sound: Sound) -> None:
        """Speech; what was being said or played is over."""
        with self._lock:
            self.counters["clips_interrupted"] += len(self._clips)
            self._clips.clear()
            self._count_skipped("talk", self._talk.push(sound))

    def talk_ends(self) -> None:
        """Silence at once."""
        with self._lock:
            self._talk.clear()

    def stream(self, sound: Sound) -> None:
        """More of a stream."""
        with self._lock:
            self._count_skipped("stream", self._stream.push(sound))

    def clip(self, sound: Sound) -> bool:
        """A text or a file, after those that wait; false where too many do."""
        with self._lock:
            if len(self._clips) >= CLIPS:
                self.counters["clips_refused"] += 1
                return False
            self._clips.append(sound)
            return True

    def no_clips(self) -> None:
        """End what is said and played."""
        with self._lock:
            self._clips.clear()

    def silence(self) -> None:
        """Forget everything: the device was away, and late sound is worth nothing."""
        with self._lock:
            self._talk.clear()
            self._stream.clear()
            self._clips.clear()

    def take(self, count: int) -> Sound:
        """The next samples, always so many."""
        with self._lock:
            talk, stream = self._talk.take(count), self._stream.take(count)
            if talk is not None:
                self.playing, taken = "talk", talk
            elif stream is not None:
                self.playing, taken = "stream", stream
            elif self._clips:
                self.playing, taken = "clip", self._next_of_clips(count)
            else:
                self.playing, taken = "nothing", _NOTHING
        return np.concatenate((taken, np.zeros(count - len(taken), np.float32)))

    def _next_of_clips(self, count: int) -> Sound:
        taken, left = self._clips[0][:count], self._clips[0][count:]
        if len(left):
            self._clips[0] = left
        else:
            self._clips.popleft()
        return taken

    def _count_skipped(self, name: str, samples: int) -> None:
        if samples:
            self.counters[f"{name}_skipped_ms"] += round(1000 * samples / self._rate)
