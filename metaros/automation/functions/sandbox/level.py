"""How far a worker can be shut in on this machine: four levels, each tried by really starting a worker in it."""

from __future__ import annotations

import enum
import sys
from collections.abc import Mapping
from dataclasses import dataclass

from metaros.errors import SandboxError

__all__ = ["Level", "Probe", "check"]


class Level(enum.IntEnum):
    """What a worker is shut in by; docs/topics/functions_sandbox.md says what each holds.

    L0: a process. L1: with limits, and never as root. L2: with its own files, one port and few system calls as well.
    L3: with its own network, processes and mounts as well.
    """

    L0 = 0
    L1 = 1
    L2 = 2
    L3 = 3


@dataclass(frozen=True, slots=True, kw_only=True)
class Probe:
    """The best level that works here; for each level "ok" or why not; and what the kernel has, in words."""

    level: Level
    reasons: Mapping[Level, str]
    facts: Mapping[str, str]


def check(probe: Probe, least: Level) -> None:
    """SandboxError, with the reason, where the machine cannot shut workers in as far as `least`."""
    if probe.level < least:
        raise SandboxError(
            f"functions are to run at {least.name} at least, this machine has {probe.level.name}: "
            f"{probe.reasons.get(least) or 'not probed'} (Python on {sys.platform})"
        )
