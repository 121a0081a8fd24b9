"""What is counted while a fleet runs: latencies in buckets, links, refusals, and samples of a process every second."""

from __future__ import annotations

import contextlib
import math
from collections import Counter
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path
from typing import Final

import psutil

__all__ = ["Counts", "Histogram", "Probe", "pss_bytes", "tree_bytes"]

LEAST_S: Final = 1e-5
STEP: Final = 1.08  # a figure is known to 4 %
BUCKETS: Final = 256


class Histogram:
    """Durations in buckets of equal ratio, from 10 us to an hour: sums are exact, quantiles good to 4 %."""

    def __init__(self) -> None:
        self._buckets: list[int] = [0] * BUCKETS
        self.count = 0
        self.most_s = 0.0

    def add(self, seconds: float) -> None:
        """One more."""
        index = int(math.log(seconds / LEAST_S) / math.log(STEP)) if seconds > LEAST_S else 0
        self._buckets[min(index, BUCKETS - 1)] += 1
        self.count += 1
        self.most_s = max(self.most_s, seconds)

    def merge(self, other: Histogram) -> None:
        """All of another one too."""
        self._buckets = [mine + theirs for mine, theirs in zip(self._buckets, other._buckets, strict=True)]
        self.count += other.count
        self.most_s = max(self.most_s, other.most_s)

    def quantile_s(self, share: float) -> float:
        """The value that this share is below; 0 where there is none."""
        left = share * self.count
        for index, count in enumerate(self._buckets):
            left -= count
            if count and left <= 0:
                return min(float(LEAST_S * STEP ** (index + 0.5)), self.most_s)
        return self.most_s

    def summary_ms(self) -> dict[str, float]:
        """p50, p90, p99 and the most, in milliseconds, and how many there were."""
        shares = {"p50": 0.5, "p90": 0.9, "p99": 0.99}
        found = {name: round(self.quantile_s(share) * 1000, 3) for name, share in shares.items()}
        return {**found, "most": round(self.most_s * 1000, 3), "count": self.count}


@dataclass(slots=True)
class Counts:
    """Of all robots of a fleet."""

    up: int = 0  # links that are up now
    ups: int = 0
    downs: Counter[str] = field(default_factory=Counter)  # reason -> links that ended, or did not come up
    goodbyes: Counter[str] = field(default_factory=Counter)  # code
    put_off: Counter[str] = field(default_factory=Counter)  # reason of a RetryLater
    rows: int = 0  # handed over
    samples: int = 0
    live: int = 0
    stored: int = 0  # frames acknowledged
    commands: int = 0
    ack_s: Histogram = field(default_factory=Histogram)
    recent_ack_s: Histogram = field(default_factory=Histogram)  # since the last look at it
    up_s: Histogram = field(default_factory=Histogram)  # from the first attempt to a link
    beat_s: Histogram = field(default_factory=Histogram)  # round trips of heartbeats

    def acknowledged(self, seconds: float) -> None:
        """A fresh frame was stored, so long after it was handed over."""
        self.recent_ack_s.add(seconds)

    def take_recent(self) -> Histogram:
        """What came since the last call; it goes into the whole."""
        recent, self.recent_ack_s = self.recent_ack_s, Histogram()
        self.ack_s.merge(recent)
        return recent


@dataclass(frozen=True, slots=True)
class Look:
    """A process at one moment."""

    cpu_s: float
    rss_bytes: int
    fds: int
    threads: int


class Probe:
    """A process seen from outside: CPU by /proc (10 ms ticks), not by the wall."""

    def __init__(self, pid: int) -> None:
        self._process = psutil.Process(pid)

    def look(self) -> Look | None:
        """Now; None when it is gone."""
        try:
            with self._process.oneshot():
                times = self._process.cpu_times()
                fds = self._process.num_fds() if hasattr(self._process, "num_fds") else 0
                memory, threads = self._process.memory_info().rss, self._process.num_threads()
                return Look(times.user + times.system, memory, fds, threads)
        except psutil.Error:
            return None


def pss_bytes(pid: int) -> int:
    """Memory with shared pages counted in parts; 0 where the system does not say."""
    with contextlib.suppress(OSError, ValueError, IndexError):
        lines = Path(f"/proc/{pid}/smaps_rollup").read_text().splitlines()
        return next((int(line.split()[1]) * 1024 for line in lines if line.startswith("Pss:")), 0)
    return 0


def tree_bytes(folder: Path, keep: Callable[[Path], bool] = lambda path: True) -> int:
    """Bytes of the files below a folder."""
    total = 0
    for path in folder.rglob("*"):
        with contextlib.suppress(OSError):
            if path.is_file() and keep(path):
                total += path.stat().st_size
    return total
