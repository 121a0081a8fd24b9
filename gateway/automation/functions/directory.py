"""What invoking needs to know of functions, as the catalogue answers it: from memory, whatever the store does."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal, Protocol

from metaros.automation.functions.calls import FunctionSpec

__all__ = ["Directory", "EventInvoke", "MappingRow", "Resolved", "Start"]

Start = Literal["LATEST", "TRIM_HORIZON", "AT_TIMESTAMP"]


@dataclass(frozen=True, slots=True)
class Resolved:
    """What a function's name and qualifier mean. `arn` has the qualifier that was asked for; `versions` are those
    that it leads to with their shares, which sum to 1: more than one for an alias with weights.
    """

    name: str
    qualifier: str
    arn: str
    versions: tuple[tuple[str, float], ...]

    def pick(self, draw: float) -> str:
        """The version of one call; `draw` is uniform in 0 to 1."""
        for version, share in self.versions:
            draw -= share
            if draw < 0:
                return version
        return self.versions[-1][0]


@dataclass(frozen=True, slots=True, kw_only=True)
class EventInvoke:
    """How events for a function are tried, and who is told of their end: ARNs, "" for nobody."""

    most_retries: int = 2
    most_age_s: float = 21_600.0
    on_success: str = ""
    on_failure: str = ""
    dead_letter: str = ""


@dataclass(frozen=True, slots=True, kw_only=True)
class MappingRow:
    """An event source mapping. `filters` are patterns, one of which has to fit; of `most_retries` and `most_age_s` -1
    is no bound. `start_ns` counts where `start` is AT_TIMESTAMP.
    """

    uuid: str
    source_arn: str
    function: str
    qualifier: str = ""
    enabled: bool = True
    batch_size: int = 100
    window_s: float = 0.0
    filters: tuple[Mapping[str, Any], ...] = ()
    most_retries: int = -1
    most_age_s: float = -1.0
    bisect: bool = False
    report_failures: bool = False
    parallel: int = 1
    on_failure: str = ""
    start: Start = "LATEST"
    start_ns: int = 0


class Directory(Protocol):
    """What is needed of the catalogue."""

    def resolve(self, name: str, qualifier: str = "") -> Resolved:
        """What a name, or an ARN, means now; UnknownFunctionError."""

    async def spec(self, name: str, version: str) -> FunctionSpec:
        """A version as the engine runs it, its code unpacked; UnknownFunctionError, StoreError, CorruptObjectError."""

    def names(self) -> list[str]:
        """Every function."""

    def event_invoke(self, name: str, qualifier: str) -> EventInvoke:
        """The settings of a function's events; the usual ones where none are set, or there is no such function."""

    def mappings(self) -> Sequence[MappingRow]:
        """Every event source mapping."""

    def note_mapping(self, uuid: str, result: str) -> None:
        """What came of its last batch, for who looks."""

    async def set_weights(self, name: str, alias: str, version: str, weights: Mapping[str, float], *, by: str) -> None:
        """Let an alias lead to a version, and to others with these shares."""

    async def files(self, name: str, version: str) -> Path:
        """Where a version's code is unpacked."""

    def on_change(self, listener: Callable[[str], None]) -> None:
        """Tell of each function that is made, changed or deleted; "" where event source mappings are."""
