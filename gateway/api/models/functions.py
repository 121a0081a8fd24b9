"""Bodies and answers of the functions' routes."""

from __future__ import annotations

from typing import Annotated, Any, Literal

from pydantic import Field

from gateway.api.models.base import Exact

__all__ = [
    "Alias",
    "AliasRequest",
    "Canary",
    "CanaryRequest",
    "Code",
    "CodeText",
    "Deploy",
    "Function",
    "FunctionDetail",
    "FunctionList",
    "FunctionLogPage",
    "Invocation",
    "InvocationKind",
    "InvocationList",
    "InvocationStatus",
    "Invoked",
    "Publish",
    "Runtime",
    "Stats",
]

InvocationStatus = Literal["ok", "error", "timeout", "throttled"]
InvocationKind = Literal["request", "event", "mapping", "test", "robot"]
Share = Annotated[float, Field(ge=0.0, le=1.0)]
Version = Annotated[str, Field(min_length=1, max_length=128)]


class FunctionMinute(Exact):
    """One minute of a function."""

    at: str
    invocations: int
    errors: int
    throttles: int
    p95_ms: float | None


class Stats(Exact):
    """A function over a window, as this gateway saw it; `running`, `iterator_age_s`, `waiting` and `dead_letters` are
    of now. `iterator_age_s` is how long the oldest message of its event source mappings has been waiting.
    """

    window_s: float
    invocations: int
    errors: int
    throttles: int
    cold_starts: int
    running: int
    p50_ms: float | None
    p95_ms: float | None
    p99_ms: float | None
    iterator_age_s: float | None
    waiting: int
    dead_letters: int
    series: list[FunctionMinute]


class Canary(Exact):
    """A new version that an alias leads to now and then: see `PUT …/canary`. Counts are of its present step."""

    version: str
    stable: str
    weight: float
    error_rate: float
    least_invocations: int
    for_s: float
    step: float
    state: Literal["running", "promoted", "rolled_back", "cancelled"]
    reason: str
    began: str
    changed: str
    invocations: int
    errors: int


class Alias(Exact):
    """A name for a version; `weights` are the shares of other versions."""

    name: str
    version: str
    description: str
    weights: dict[str, float]
    canary: Canary | None


class Trigger(Exact):
    """What calls a function; `title` says it in words."""

    kind: Literal["rule", "schedule", "mapping"]
    id: str
    title: str
    enabled: bool


class Concurrency(Exact):
    """`reserved`: at most so many calls run at a time, null: no bound of its own. `warm`: workers that are kept."""

    reserved: int | None
    warm: int


class Function(Exact):
    """A function, as `$LATEST` is. `runtime` is what was asked for, `interpreter` what it runs on here."""

    name: str
    arn: str
    description: str
    runtime: str
    interpreter: str
    handler: str
    state: str
    reason: str
    timeout_s: float
    memory_mb: int
    disk_mb: int
    code_sha256: str
    code_bytes: int
    modified: str
    versions: int
    aliases: list[Alias]
    triggers: list[Trigger]
    concurrency: Concurrency
    stats: Stats


class PublishedVersion(Exact):
    """One that never changes."""

    version: str
    description: str
    code_sha256: str
    modified: str


class EventSettings(Exact):
    """How events for it are tried; the last three are ARNs, or empty."""

    most_retries: int
    most_age_s: float
    on_success: str
    on_failure: str
    dead_letter: str


class EventSource(Exact):
    """An event source mapping: topics of robots that call it in batches."""

    uuid: str
    source: str
    qualifier: str
    enabled: bool
    batch_size: int
    window_s: float
    most_retries: int
    most_age_s: float
    bisect: bool
    report_failures: bool
    parallel: int
    on_failure: str
    result: str


class FunctionDetail(Function):
    """With what belongs to it. Values of `environment` are shown to who may change functions, and empty for others."""

    environment: dict[str, str]
    layers: list[str]
    published: list[PublishedVersion]
    event_invoke: EventSettings
    mappings: list[EventSource]


class FunctionList(Exact):
    """By name; `next` is the `after` of the next page, null at the end."""

    functions: list[Function]
    next: str | None


class EventRequest(Exact):
    """How events are to be tried, and who is told of their end, by ARN: "" is nobody. What is left out stays."""

    most_retries: int | None = Field(default=None, ge=0, le=2)
    most_age_s: int | None = Field(default=None, ge=60, le=21_600)
    on_success: str | None = Field(default=None, max_length=350)
    on_failure: str | None = Field(default=None, max_length=350)
    dead_letter: str | None = Field(default=None, max_length=350)


class Deploy(Exact):
    """What a function is to be: what is left out stays as it is, or is the usual of a new one.

    `zip` is base64, of up to 11 MiB; a larger one goes to `PUT …/code`. `publish` makes a version of it, and `alias`
    leads to that from then on. `reserved` -1 takes its bound away. `warm` workers are kept for the `alias`.
    """

    zip: str | None = Field(default=None, min_length=4)
    handler: str | None = Field(default=None, min_length=1, max_length=128)
    runtime: str | None = Field(default=None, max_length=32)
    timeout_s: int | None = Field(default=None, ge=1)
    memory_mb: int | None = Field(default=None, ge=128)
    disk_mb: int | None = Field(default=None, ge=512)
    environment: dict[str, str] | None = None
    description: str | None = Field(default=None, max_length=256)
    layers: list[str] | None = Field(default=None, max_length=5)
    reserved: int | None = Field(default=None, ge=-1)
    warm: int | None = Field(default=None, ge=0)
    event_invoke: EventRequest | None = None
    publish: bool = False
    alias: str = Field(default="", max_length=128)


class Publish(Exact):
    """A version of what `$LATEST` is now."""

    description: str = Field(default="", max_length=256)


class AliasRequest(Exact):
    """What an alias is to lead to."""

    version: Version
    description: str | None = Field(default=None, max_length=256)
    weights: dict[str, Share] = Field(default_factory=dict, max_length=1)


class CanaryRequest(Exact):
    """`version` gets `weight` of the alias' calls, and is rolled back as soon as more than `error_rate` of them failed,
    of at least `least_invocations`. After `for_s` it gets `step` more, and again; with `step` 0 all calls at once.
    """

    version: Version
    weight: float = Field(default=0.1, gt=0.0, lt=1.0)
    error_rate: float = Field(default=0.05, ge=0.0, lt=1.0)
    least_invocations: int = Field(default=20, ge=1, le=1_000_000)
    for_s: float = Field(default=300.0, ge=1.0, le=604_800.0)
    step: float = Field(default=0.0, ge=0.0, le=1.0)


class Invoked(Exact):
    """What came of a call. `payload` is JSON where it is some, else text. An event has its `request_id` alone."""

    request_id: str
    version: str = ""
    status: Literal["ok", "error", "timeout", "accepted", "dry"]
    payload: Any = None
    error_type: str = ""
    duration_ms: float = 0.0
    init_ms: float = 0.0
    max_memory_mb: int = 0
    log: str = ""


class Invocation(Exact):
    """A call that is over; `log` is its last 4 KiB, where one may see them."""

    id: str
    request_id: str
    function: str
    version: str
    qualifier: str
    kind: InvocationKind
    robot: str
    status: InvocationStatus
    error_type: str
    error_message: str
    began: str
    duration_ms: float
    init_ms: float
    max_memory_mb: int
    log: str


class InvocationList(Exact):
    """The newest first; `next` is the `before` of the next page, null at the end."""

    invocations: list[Invocation]
    next: str | None


class FunctionLogLine(Exact):
    """One line; `request_id` is empty for what was written between two calls."""

    cursor: int
    at: str
    request_id: str
    version: str
    text: str


class FunctionLogPage(Exact):
    """Lines that the gateway has in memory, the oldest first; `next` is the `before` of the page before it."""

    lines: list[FunctionLogLine]
    next: int | None


class CodeFile(Exact):
    """A file of the code."""

    path: str
    size_bytes: int


class Code(Exact):
    """The files of a version's code, by path; of very many the first."""

    version: str
    files: list[CodeFile]
    truncated: bool


class CodeText(Exact):
    """A file's text; what is no text is shown as far as it is one."""

    path: str
    text: str
    truncated: bool


class Pool(Exact):
    """The workers of one version."""

    function: str
    version: str
    entry: str
    workers: int
    busy: int
    starting: int
    waiting: int
    calls: int
    cold_starts: int
    failures: int
    memory_mb: int
    init_error: str


class Runtime(Exact):
    """Where functions run here. `level` is the sandbox, `reasons` say of each level "ok" or why it is not to be had;
    both are found out at the first call. `trouble` is why no function runs.
    """

    on: bool
    started: bool
    trouble: str
    level: str
    require: str
    reasons: dict[str, str]
    entry: str
    interpreter: str
    runtimes: list[str]
    workers: int
    most_workers: int
    memory_mb: int
    pools: list[Pool]
