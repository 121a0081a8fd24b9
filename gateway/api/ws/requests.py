"""What a client of the stream asks, checked field by field."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

import orjson

from gateway.api.ws.resume import Resumed, read_resume
from gateway.domain.channel import Channel
from gateway.domain.principal import Principal
from gateway.errors import InvalidRequestError
from gateway.live.feeds import FleetSubscription, MetricSubscription
from gateway.live.scope import RobotPattern, VisibleRobots, matching
from metaros.idl.globs import Glob
from metaros.limits import LIMITS

__all__ = [
    "SamplesRequest",
    "make_feed",
    "number_field",
    "number_of",
    "read_request",
    "read_samples",
    "text_field",
]

DEFAULT_QUEUE_BYTES = 1024 * 1024
DEFAULT_METRICS_HZ = 2.0
MAX_RATE_HZ = 1000.0
MAX_SERIES_GLOBS = 256


def read_request(text: str | None) -> dict[str, Any]:
    """A JSON object, or InvalidRequestError."""
    if text is None:
        raise InvalidRequestError("requests are JSON texts")
    if len(text) > LIMITS.json_bytes:
        raise InvalidRequestError(f"a request has at most {LIMITS.json_bytes} bytes")
    try:
        request = orjson.loads(text)
    except orjson.JSONDecodeError as error:
        raise InvalidRequestError(f"no JSON: {error}") from error
    if not isinstance(request, dict):
        raise InvalidRequestError("a request is a JSON object")
    return request


@dataclass(frozen=True, slots=True)
class SamplesRequest:
    """A subscription to samples, as it was asked for."""

    number: int
    wants: Callable[[Channel], bool]
    max_rate_hz: float
    latest: bool
    queue_bytes: int
    json: bool
    resume: tuple[Resumed, ...] = ()


def number_of(request: Mapping[str, Any]) -> int:
    """The number of a subscription."""
    number = request.get("id")
    if not isinstance(number, int) or isinstance(number, bool) or not 0 <= number < 2**32:
        raise InvalidRequestError("id is a number from 0 to 4294967295 of the client's choice")
    return number


def make_feed(
    request: Mapping[str, Any],
    *,
    revisions: Callable[[], Mapping[str, int]],
    describe: Callable[[str], dict[str, Any]],
    principal: Principal,
) -> MetricSubscription | FleetSubscription:
    """The JSON subscription a request describes, of robots that the principal sees; the error names the field."""
    number = number_of(request)
    if request["op"] == "subscribe_fleet":
        return FleetSubscription(number, revisions=lambda: _seen(revisions(), principal), describe=describe)
    return _metrics(number, request, principal)


def read_samples(request: Mapping[str, Any], principal: Principal) -> SamplesRequest:
    """The samples a request asks for, of robots that the principal sees; the error names the field."""
    number = number_of(request)
    mode, encoding = request.get("mode", "latest"), request.get("encoding", "cdr")
    if mode not in ("latest", "queue"):
        raise InvalidRequestError('mode is "latest" or "queue"')
    if encoding not in ("cdr", "json"):
        raise InvalidRequestError('encoding is "cdr" or "json"')
    queue_bytes = number_field(request, "queue_bytes", DEFAULT_QUEUE_BYTES, low=1, high=LIMITS.viewer_queue_bytes)
    return SamplesRequest(
        number,
        matching(_robots(request, principal), Glob(text_field(request, "topics"))),
        max_rate_hz=number_field(request, "max_rate_hz", 0.0, low=0.0, high=MAX_RATE_HZ),
        latest=mode == "latest",
        queue_bytes=int(queue_bytes),
        json=encoding == "json",
        resume=tuple(item for item in read_resume(request) if principal.sees(item.robot)),
    )


def number_field(request: Mapping[str, Any], name: str, default: float | None, *, low: float, high: float) -> float:
    """A finite number between two bounds; null and absence give the default, where there is one."""
    value = request.get(name)
    if value is None and default is not None:
        return default
    if isinstance(value, int | float) and not isinstance(value, bool) and low <= value <= high:
        return float(value)
    raise InvalidRequestError(f"{name} is a number from {low:g} to {high:g}")


def text_field(request: Mapping[str, Any], name: str) -> str:
    """A text that is not empty."""
    value = request.get(name)
    if not isinstance(value, str) or not value:
        raise InvalidRequestError(f"{name} is a text")
    return value


def _robots(request: Mapping[str, Any], principal: Principal) -> RobotPattern:
    pattern = Glob(text_field(request, "robots"))
    return pattern if principal.sees_all else VisibleRobots(pattern, principal.sees)


def _seen(revisions: Mapping[str, int], principal: Principal) -> Mapping[str, int]:
    if principal.sees_all:
        return revisions
    return {robot: revision for robot, revision in revisions.items() if principal.sees(robot)}


def _metrics(number: int, request: Mapping[str, Any], principal: Principal) -> MetricSubscription:
    series = request.get("series", ["**"])
    if not isinstance(series, list) or not 1 <= len(series) <= MAX_SERIES_GLOBS:
        raise InvalidRequestError(f"series is a list of 1 to {MAX_SERIES_GLOBS} patterns")
    globs = [Glob(text_field({"series": item}, "series"), separator=".") for item in series]
    rate = number_field(request, "max_rate_hz", DEFAULT_METRICS_HZ, low=0.01, high=MAX_RATE_HZ)
    return MetricSubscription(number, _robots(request, principal), globs, max_rate_hz=rate)
