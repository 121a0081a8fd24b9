"""`metaros play`: a CARMEN log as LaserScan, Odometry and tf."""

from __future__ import annotations

import threading
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

__all__ = ["PlayReport", "play_carmen"]


@dataclass(frozen=True, slots=True)
class PlayReport:
    """What a replay has sent so far."""

    scans: int = 0
    odometry: int = 0
    malformed: int = 0
    log_s: float = 0.0


def play_carmen(
    path: str | Path,
    *,
    name: str,
    context: Any,
    rate: float = 1.0,
    limit_s: float | None = None,
    loop: bool = False,
    wait_subscriber_s: float = 5.0,
    on_progress: Callable[[PlayReport], None] | None = None,
    stop: threading.Event | None = None,
) -> PlayReport:
    """Replay `path` on /<name>/scan, /<name>/odom and /<name>/tf; `rate` 0 is full speed, 1 original, 20 twenty-fold.

    Blocks until the end of the log, `limit_s` seconds of log time, or `stop`. Waits up to `wait_subscriber_s` for
    subscribers before the first message.
    """
    raise NotImplementedError
