"""Every metric of `/metrics`, in one table; `docs/reference/metrics.md` lists the same.

No label takes a value that a client could make up: routes and methods come from our own tables, and of robots only
the `metrics_robots` that lag most have series of their own.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

__all__ = ["METRICS", "MetricRow", "metric"]

Kind = Literal["counter", "gauge", "histogram"]


@dataclass(frozen=True, slots=True)
class MetricRow:
    """One metric: a counter's name is without `_total`, which the text adds."""

    name: str
    kind: Kind
    labels: tuple[str, ...]
    meaning: str

    @property
    def shown(self) -> str:
        """Its name as Prometheus knows it."""
        return f"{self.name}_total" if self.kind == "counter" else self.name


METRICS: tuple[MetricRow, ...] = (
    MetricRow("metaros_build", "gauge", ("version", "python"), "always 1; its labels say what runs"),
    MetricRow("metaros_ready", "gauge", (), "1 when /readyz says 200"),
    MetricRow("metaros_draining", "gauge", (), "1 while the gateway ends, and takes nobody new"),
    MetricRow("metaros_loop_lag_seconds", "gauge", (), "how late the event loop was at its last look, once a second"),
    MetricRow("metaros_http_requests", "counter", ("method", "route", "status"), "answered requests; status is 2xx …"),
    MetricRow("metaros_http_request_seconds", "histogram", ("route",), "from the head to the answer's last byte"),
    MetricRow("metaros_sockets", "gauge", ("route",), "WebSockets that are open"),
    MetricRow("metaros_sockets_opened", "counter", ("route",), "WebSockets that were accepted"),
    MetricRow("metaros_rpcs", "counter", ("method", "status"), "ended gRPC calls of programs; status as HTTP's"),
    MetricRow("metaros_rpc_seconds", "histogram", ("method",), "of them, from the call to its end"),
    MetricRow("metaros_connections", "gauge", (), "connections to the HTTP port"),
    MetricRow("metaros_robots", "gauge", ("state",), "robots that are online, online elsewhere, and offline"),
    MetricRow("metaros_link_samples", "counter", (), "samples and metric rows that arrived"),
    MetricRow("metaros_link_bytes", "counter", (), "their bytes"),
    MetricRow("metaros_link_duplicates", "counter", (), "samples that had come before, and were put aside"),
    MetricRow("metaros_link_gaps", "counter", (), "losses that robots declared"),
    MetricRow("metaros_link_lost_samples", "counter", (), "samples in those losses"),
    MetricRow("metaros_link_over_quota_samples", "counter", (), "live samples dropped: their robot is over its quota"),
    MetricRow("metaros_link_put_off", "counter", (), "lanes told to send later: their robot is over its quota"),
    MetricRow("metaros_link_rtt_seconds", "gauge", ("quantile",), "round trips of the robots that are online"),
    MetricRow("metaros_lag_seconds", "gauge", ("quantile",), "lags of the robots that are online"),
    MetricRow("metaros_backlog_bytes", "gauge", (), "what all robots hold and nobody has acknowledged"),
    MetricRow("metaros_robot_lag_seconds", "gauge", ("robot",), "how old the newest sample was when it came"),
    MetricRow("metaros_robot_backlog_bytes", "gauge", ("robot",), "what a robot holds and nobody has acknowledged"),
    MetricRow("metaros_queue_bytes", "gauge", ("queue",), "what waits in a queue that is bounded in bytes"),
    MetricRow("metaros_queue_limit_bytes", "gauge", ("queue",), "its bound"),
    MetricRow("metaros_queue_items", "gauge", ("queue",), "what waits in a queue that is bounded in items"),
    MetricRow("metaros_queue_limit_items", "gauge", ("queue",), "its bound"),
    MetricRow("metaros_viewers", "gauge", (), "subscribing connections, of all protocols"),
    MetricRow("metaros_viewer_dropped_samples", "counter", (), "samples that viewers lost: they do not keep up"),
    MetricRow("metaros_agent_lost_samples", "gauge", ("class",), "samples that agents gave up since each started"),
    MetricRow("metaros_store_ok", "gauge", (), "0 while the database takes no commits"),
    MetricRow("metaros_objects_ok", "gauge", (), "0 while messages cannot be moved to the object store"),
    MetricRow("metaros_store_commits", "counter", (), "commits of what robots sent"),
    MetricRow("metaros_store_samples", "counter", (), "messages that were committed"),
    MetricRow("metaros_store_rows", "counter", (), "metric rows that were committed"),
    MetricRow("metaros_store_bytes", "gauge", ("class",), "what the store holds; at most five minutes old"),
    MetricRow("metaros_store_keep_bytes", "gauge", (), "--retention-mib: what it may hold"),
    MetricRow("metaros_disk_free_bytes", "gauge", (), "of the disk with the data directory"),
    MetricRow("metaros_leases", "gauge", (), "robots that somebody drives"),
    MetricRow("metaros_function_invocations", "counter", (), "calls of functions that ran"),
    MetricRow("metaros_function_errors", "counter", (), "of them those that failed, timeouts included"),
    MetricRow("metaros_function_throttles", "counter", (), "calls of functions that found no room"),
    MetricRow("metaros_function_cold_starts", "counter", (), "calls that waited for a worker's start"),
    MetricRow("metaros_function_seconds", "counter", (), "how long calls of functions took together"),
    MetricRow("metaros_function_running", "gauge", (), "calls of functions under way"),
    MetricRow("metaros_function_workers", "gauge", (), "worker processes"),
    MetricRow("metaros_function_duration_seconds", "gauge", ("quantile",), "calls of the last hour, of all functions"),
    MetricRow("metaros_function_iterator_age_seconds", "gauge", (), "how long a mapping's oldest message has waited"),
    MetricRow("metaros_deliveries", "gauge", ("state",), "deliveries that are live, and dead letters"),
    MetricRow("metaros_deliveries_ended", "counter", ("outcome",), "tries of deliveries here, by how they ended"),
    MetricRow("metaros_cluster_peers", "gauge", (), "other gateways that are met"),
    MetricRow("metaros_cluster_robots", "gauge", (), "robots that are linked to other gateways, and known here"),
    MetricRow("metaros_cluster_sent_messages", "counter", (), "what other gateways were told"),
    MetricRow("metaros_cluster_sent_bytes", "counter", (), "its bytes"),
    MetricRow("metaros_cluster_received_messages", "counter", (), "what other gateways told"),
    MetricRow("metaros_cluster_received_bytes", "counter", (), "its bytes"),
    MetricRow("metaros_cluster_asks", "counter", (), "questions to other gateways"),
    MetricRow("metaros_cluster_dropped_messages", "counter", (), "not sent, as so much waited for that gateway"),
    MetricRow("metaros_cluster_refused_messages", "counter", (), "forged, for somebody else, or a second time"),
    MetricRow("metaros_cluster_meetings_lost", "counter", (), "times that something was missing: met anew"),
    MetricRow("metaros_cluster_live_samples", "counter", (), "live samples sent to gateways whose viewers want them"),
    MetricRow("metaros_cluster_live_bytes", "counter", (), "their bytes"),
    MetricRow("metaros_cluster_live_dropped_samples", "counter", (), "of them those not sent, as so much waited"),
    MetricRow("metaros_sample_stage_seconds", "histogram", ("stage",), "stages of followed samples: trace_a_sample.md"),
    MetricRow("metaros_traces_followed", "counter", (), "samples that were followed"),
    MetricRow("metaros_traces_skipped", "counter", (), "samples that were marked, and one too many to follow"),
    MetricRow("metaros_traces_exported", "counter", (), "traces that the collector of --otlp took"),
    MetricRow("metaros_traces_lost", "counter", (), "traces that it did not take"),
)

_BY_NAME = {row.name: row for row in METRICS}


def metric(name: str) -> MetricRow:
    """The row of that name; KeyError for one that the table lacks, which is a mistake of ours."""
    return _BY_NAME[name]
