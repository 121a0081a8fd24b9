"""What is run, with what, and what came of it: the words between the engine and whoever calls it."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path

__all__ = ["FunctionSpec", "Invocation", "Outcome"]


@dataclass(frozen=True, slots=True, kw_only=True)
class FunctionSpec:
    """A function's version as the engine runs it; `key` is another one whenever anything of it is.

    `code_dir` and `layer_dirs` are unpacked and read-only. `min_workers` are kept warm; `max_workers` bounds how many
    calls run at a time, and `reserved` further bounds it over all versions of `name` (None: no bound).
    """

    key: str
    name: str
    version: str
    arn: str
    handler: str
    code_dir: Path
    runtime: str = "python3.11"
    layer_dirs: tuple[Path, ...] = ()
    environment: Mapping[str, str] = field(default_factory=dict)
    timeout_s: float = 3.0
    memory_mb: int = 128
    disk_mb: int = 512
    min_workers: int = 0
    max_workers: int = 10
    reserved: int | None = None


@dataclass(frozen=True, slots=True, kw_only=True)
class Invocation:
    """One call. `client_context` is JSON; `tail` asks for the last 4 KiB of its log."""

    request_id: str
    payload: bytes
    arn: str = ""
    client_context: str = ""
    trace_id: str = ""
    tail: bool = False


@dataclass(frozen=True, slots=True, kw_only=True)
class Outcome:
    """What came of a call. `error_type` is "" where the handler returned; then `payload` is what it returned, else
    the document of the error. `init_ms` is 0 for a warm start. `log` is its last 4 KiB.
    """

    payload: bytes
    error_type: str = ""
    duration_ms: float = 0.0
    init_ms: float = 0.0
    max_memory_mb: int = 0
    log: bytes = b""
    content_type: str = "application/json"

    @property
    def ok(self) -> bool:
        """Whether the handler returned."""
        return not self.error_type
