"""`metaros sim`: one process, N robots, one 50 Hz loop."""

from __future__ import annotations

import threading
from collections.abc import Sequence
from pathlib import Path
from typing import Any

__all__ = ["run_sim"]


def run_sim(
    *,
    robots: int = 3,
    first: int = 1,
    seed: int = 1,
    context: Any,
    faults: Sequence[str] = (),
    resume_after_s: float = 10.0,
    camera: bool = True,
    status_file: Path | None = None,
    stop: threading.Event | None = None,
) -> None:
    """Drive robots `sim_<first>` … until `stop` is set; `faults` are texts like `sim_2:stuck_wheel@30`.

    Blocks. Raises ConfigError for a bad count, fault or setting before anything is started. `status_file` is written
    atomically when every publisher is declared.
    """
    raise NotImplementedError
