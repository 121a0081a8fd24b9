"""Exports traced samples to an OpenTelemetry collector, by OTLP over HTTP; needs the extra `otel`.

They wait in a bounded queue, and a thread sends them: a collector that is slow or gone costs traces, counted, and
nothing else.
"""

from __future__ import annotations

import asyncio
import hashlib
import logging
from collections import deque
from collections.abc import Sequence
from typing import Any, Final, Protocol
from urllib.parse import urlsplit

from gateway.ops.sample_trace import TracedSample
from metaros.errors import ConfigError
from metaros.limits import LIMITS, Limits

__all__ = ["Exporter", "OtlpQueue", "check_otlp", "open_exporter"]

log = logging.getLogger(__name__)

_EVERY_S: Final = 1.0
_AT_ONCE: Final = 256
_SEND_S: Final = 10.0
_LAST_S: Final = 2.0


class Exporter(Protocol):
    """Sends spans; blocks."""

    def send(self, traced_samples: Sequence[TracedSample]) -> bool:
        """Whether the collector took them."""

    def close(self) -> None:
        """End its connections."""


def check_otlp(url: str) -> None:
    """ConfigError for what is no collector's address, or when the extra is not installed."""
    if not url:
        return
    parts = urlsplit(url)
    if parts.scheme not in ("http", "https") or not parts.hostname:
        raise ConfigError(f"--otlp {url}: it is http://HOST:4318 or https://…")
    try:
        import opentelemetry.exporter.otlp.proto.http.trace_exporter  # noqa: F401  # heavy
    except ImportError as error:
        raise ConfigError("--otlp needs OpenTelemetry's packages: pip install 'metaros[gateway,otel]'") from error


class OtlpQueue:
    """What waits to be sent."""

    def __init__(self, exporter: Exporter, *, limits: Limits = LIMITS) -> None:
        self._exporter = exporter
        self._waiting: deque[TracedSample] = deque()
        self._limits = limits
        self._failing = False
        self.exported = 0
        self.lost = 0

    def put(self, traced: TracedSample) -> None:
        """Queue one; the oldest goes where there is no room."""
        if len(self._waiting) >= self._limits.traces_export:
            self._waiting.popleft()
            self.lost += 1
        self._waiting.append(traced)

    async def run(self) -> None:
        """Send once a second, until cancelled."""
        while True:
            await asyncio.sleep(_EVERY_S)
            while self._waiting:
                await self._send()

    async def close(self) -> None:
        """Send what waits, if the collector takes it soon."""
        try:
            async with asyncio.timeout(_LAST_S):
                while self._waiting:
                    await self._send()
        except TimeoutError:
            self.lost += len(self._waiting)
        await asyncio.to_thread(self._exporter.close)

    async def _send(self) -> None:
        some = [self._waiting.popleft() for _ in range(min(_AT_ONCE, len(self._waiting)))]
        if await asyncio.to_thread(self._exporter.send, some):
            self.exported += len(some)
            self._failing = False
            return
        self.lost += len(some)
        if not self._failing:
            log.warning("the collector of --otlp does not take traces; they are lost meanwhile")
        self._failing = True


class _Otlp:
    """OpenTelemetry's own exporter, given spans whose times are known already."""

    def __init__(self, url: str, *, gateway_id: str) -> None:
        from opentelemetry.exporter.otlp.proto.http.trace_exporter import OTLPSpanExporter  # heavy, and an extra
        from opentelemetry.sdk.resources import Resource

        parts = urlsplit(url)
        endpoint = url if parts.path.strip("/") else f"{url.rstrip('/')}/v1/traces"
        self._exporter = OTLPSpanExporter(endpoint=endpoint, timeout=_SEND_S)
        self._resource = Resource({"service.name": "metaros-gateway", "service.instance.id": gateway_id})

    def send(self, traced_samples: Sequence[TracedSample]) -> bool:
        """Whether the collector took them."""
        from opentelemetry.sdk.trace.export import SpanExportResult

        spans = [span for traced in traced_samples for span in self._spans(traced)]
        return self._exporter.export(spans) is SpanExportResult.SUCCESS

    def close(self) -> None:
        """End its connections."""
        self._exporter.shutdown()  # type: ignore[no-untyped-call]

    def _spans(self, traced: TracedSample) -> list[Any]:
        from opentelemetry.sdk.trace import ReadableSpan
        from opentelemetry.trace import SpanContext, TraceFlags

        trace_id, flags = int(traced.times.trace_id, 16), TraceFlags(TraceFlags.SAMPLED)
        stages = traced.spans()
        attributes: dict[str, str | int] = {
            "metaros.robot": traced.robot,
            "metaros.topic": traced.topic,
            "metaros.class": traced.delivery,
            "metaros.seq": traced.times.seq,
        }
        root = SpanContext(trace_id, int(traced.times.span_id, 16), is_remote=False, trace_flags=flags)
        whole = ReadableSpan(
            "sample",
            root,
            resource=self._resource,
            attributes=attributes,
            start_time=stages[0].start_ns,
            end_time=max(stage.end_ns for stage in stages),
        )
        return [
            whole,
            *(
                ReadableSpan(
                    stage.name,
                    SpanContext(trace_id, _span_id(traced, stage.name), is_remote=False, trace_flags=flags),
                    parent=root,
                    resource=self._resource,
                    attributes=attributes,
                    start_time=stage.start_ns,
                    end_time=stage.end_ns,
                )
                for stage in stages
            ),
        ]


def open_exporter(url: str, *, gateway_id: str) -> Exporter:
    """The exporter to a collector's address."""
    return _Otlp(url, gateway_id=gateway_id)


def _span_id(traced: TracedSample, stage: str) -> int:
    """A stage's id: the same whoever computes it, and never 0."""
    text = f"{traced.times.trace_id}{traced.times.span_id}{stage}"
    return int.from_bytes(hashlib.sha256(text.encode()).digest()[:8], "big") or 1
