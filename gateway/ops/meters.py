"""Counters and histograms of requests, sockets, calls, commits, and stages of traced samples."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from typing import Any, Final

from prometheus_client import CollectorRegistry, Counter, Gauge, Histogram
from prometheus_client.exposition import choose_encoder
from prometheus_client.gc_collector import GCCollector
from prometheus_client.metrics_core import CounterMetricFamily, GaugeMetricFamily, Metric
from prometheus_client.process_collector import ProcessCollector

from gateway.ops.metric_table import metric
from gateway.ops.sample_trace import TracedSample

__all__ = ["Families", "Meters", "text_of"]

_REQUEST_S: Final = (0.001, 0.0025, 0.005, 0.01, 0.025, 0.05, 0.1, 0.25, 0.5, 1.0, 2.5, 10.0)
_STAGE_S: Final = (0.0001, 0.00025, 0.0005, 0.001, 0.0025, 0.005, 0.01, 0.025, 0.05, 0.1, 0.25, 0.5, 1.0, 5.0, 60.0)


class Meters:
    """The counters of one gateway, in a registry of its own; safe on every thread."""

    def __init__(self) -> None:
        self.registry = CollectorRegistry()
        ProcessCollector(registry=self.registry)
        GCCollector(registry=self.registry)
        self._requests = self._counter("metaros_http_requests")
        self._request_s = self._histogram("metaros_http_request_seconds", _REQUEST_S)
        self._answers: dict[tuple[str, str, int], tuple[Counter, Histogram]] = {}  # as many as there are labels
        self._sockets = self._gauge("metaros_sockets")
        self._opened = self._counter("metaros_sockets_opened")
        self._rpcs = self._counter("metaros_rpcs")
        self._rpc_s = self._histogram("metaros_rpc_seconds", _REQUEST_S)
        self._commits = self._counter("metaros_store_commits")
        self._samples = self._counter("metaros_store_samples")
        self._rows = self._counter("metaros_store_rows")
        self._stages = self._histogram("metaros_sample_stage_seconds", _STAGE_S)

    def request(self, method: str, route: str, status: int, *, seconds: float) -> None:
        """A request was answered. `route` is a template of ours, never a path."""
        found = self._answers.get((method, route, status))
        if found is None:  # finding them by their labels takes longer than counting
            found = self._requests.labels(method, route, f"{status // 100}xx"), self._request_s.labels(route)
            self._answers[method, route, status] = found
        found[0].inc()
        found[1].observe(seconds)

    def socket(self, route: str, *, opened: bool) -> None:
        """A WebSocket was accepted, or one that was is over."""
        if opened:
            self._opened.labels(route).inc()
        self._sockets.labels(route).inc(1 if opened else -1)

    def rpc(self, method: str, status: int, *, seconds: float) -> None:
        """A gRPC call of a table of ours has ended; `status` as HTTP would say it."""
        self._rpcs.labels(method, f"{status // 100}xx").inc()
        self._rpc_s.labels(method).observe(seconds)

    def commit(self, *, samples: int, rows: int) -> None:
        """The store has so many more."""
        self._commits.inc()
        self._samples.inc(samples)
        self._rows.inc(rows)

    def traced(self, traced: TracedSample) -> None:
        """A followed sample is at its end."""
        for span in traced.spans():
            self._stages.labels(span.name).observe(span.duration_ns / 1e9)

    def _counter(self, name: str) -> Counter:
        row = metric(name)
        return Counter(row.name, row.meaning, row.labels, registry=self.registry)

    def _gauge(self, name: str) -> Gauge:
        row = metric(name)
        return Gauge(row.name, row.meaning, row.labels, registry=self.registry)

    def _histogram(self, name: str, buckets: tuple[float, ...]) -> Histogram:
        row = metric(name)
        return Histogram(row.name, row.meaning, row.labels, buckets=buckets, registry=self.registry)


class Families:
    """What was read off the living parts for one scrape."""

    def __init__(self) -> None:
        self._families: dict[str, Metric] = {}

    def put(self, name: str, value: float, *labels: str) -> None:
        """One series; the name has its row in the table."""
        family: Any = self._families.get(name)
        if family is None:
            row = metric(name)
            make = CounterMetricFamily if row.kind == "counter" else GaugeMetricFamily
            family = self._families[name] = make(row.name, row.meaning, labels=row.labels)
        family.add_metric(labels, float(value))

    def collect(self) -> Iterator[Metric]:
        """In the table's order of their first values."""
        yield from self._families.values()


class _Combined:
    """Several collectors as the one that an encoder asks."""

    def __init__(self, parts: Iterable[Any]) -> None:
        self._parts = tuple(parts)

    def collect(self) -> Iterator[Metric]:
        """All of them, without the moments when series began, of which the client adds one to each."""
        for part in self._parts:
            for family in part.collect():
                family.samples = [sample for sample in family.samples if not sample.name.endswith("_created")]
                yield family


def text_of(meters: Meters, families: Families, *, accept: str = "") -> tuple[bytes, str]:
    """The scrape's body and its content type: OpenMetrics for who asks for it, else Prometheus's own text."""
    encode, content_type = choose_encoder(accept)
    together: Any = _Combined((meters.registry, families))
    return encode(together), content_type
