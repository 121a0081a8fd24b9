"""What a process is, apart from how it is kept."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

from metaros.ros2.launch.substitution import SomeSubstitutionsType

__all__ = ["Executable"]


class Executable:
    """A command with its name, prefix, folder and environment, as of `ExecuteProcess`."""

    def __init__(self, *, cmd: Iterable[SomeSubstitutionsType], **options: Any) -> None:
        self.cmd = list(cmd)
        self.options = options
