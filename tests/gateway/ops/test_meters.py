"""The table of metrics, what is counted, and that docs and text say the same."""

from __future__ import annotations

import re
from pathlib import Path

import pytest
from prometheus_client.openmetrics.parser import text_string_to_metric_families as parse_open
from prometheus_client.parser import text_string_to_metric_families as parse

from gateway.ops.meters import Families, Meters, text_of
from gateway.ops.metric_table import METRICS, metric

PAGE = Path(__file__).resolve().parents[3] / "docs" / "reference" / "metrics.md"


def test_the_docs_have_the_table() -> None:
    rows = re.findall(r"^\| `([a-z_]+)` \| (\w+) \| (.*?) \| (.*) \|$", PAGE.read_text(), re.MULTILINE)
    said = [(name, kind, tuple(re.findall(r"`(\w+)`", labels)), meaning) for name, kind, labels, meaning in rows]
    assert said == [(row.shown, row.kind, row.labels, row.meaning) for row in METRICS]


def test_what_the_process_tells_is_in_the_docs() -> None:
    body, _ = text_of(Meters(), Families())
    names = {family.name for family in parse(body.decode())}
    own = {name for name in names if not name.startswith("metaros_")}
    assert own
    assert [name for name in sorted(own) if name not in PAGE.read_text()] == []


def test_counted_requests_calls_sockets_and_commits() -> None:
    meters, families = Meters(), Families()
    meters.request("GET", "/api/v1/robots", 200, seconds=0.004)
    meters.request("GET", "/api/v1/robots", 204, seconds=0.2)
    meters.request("GET", "/api/v1/robots", 503, seconds=0.2)
    meters.socket("/api/v1/stream", opened=True)
    meters.socket("/api/v1/stream", opened=True)
    meters.socket("/api/v1/stream", opened=False)
    meters.rpc("/metaros.v1.FleetService/GetRobot", 404, seconds=0.01)
    meters.commit(samples=5, rows=7)
    families.put("metaros_robot_lag_seconds", 1.5, 'r"\n1')
    body, kind = text_of(meters, families)
    assert kind.startswith("text/plain")
    found = {
        (sample.name, *sample.labels.values()): sample.value
        for family in parse(body.decode())
        for sample in family.samples
        if not sample.name.startswith(("process_", "python_"))
    }
    assert found["metaros_http_requests_total", "GET", "/api/v1/robots", "2xx"] == 2
    assert found["metaros_http_requests_total", "GET", "/api/v1/robots", "5xx"] == 1
    assert found["metaros_http_request_seconds_bucket", "0.005", "/api/v1/robots"] == 1
    assert found["metaros_http_request_seconds_count", "/api/v1/robots"] == 3
    assert found["metaros_sockets", "/api/v1/stream"] == 1
    assert found["metaros_sockets_opened_total", "/api/v1/stream"] == 2
    assert found["metaros_rpcs_total", "/metaros.v1.FleetService/GetRobot", "4xx"] == 1
    assert found["metaros_store_samples_total",] == 5
    assert found["metaros_store_rows_total",] == 7
    assert found["metaros_robot_lag_seconds", 'r"\n1'] == 1.5
    assert not [name for name, *_ in found if name.endswith("_created")]


def test_open_metrics_for_who_asks_for_it() -> None:
    families = Families()
    families.put("metaros_link_samples", 3)
    body, kind = text_of(Meters(), families, accept="application/openmetrics-text; version=1.0.0")
    assert kind.startswith("application/openmetrics-text")
    assert "metaros_link_samples" in {family.name for family in parse_open(body.decode())}


def test_a_metric_that_the_table_lacks_is_a_mistake() -> None:
    with pytest.raises(KeyError):
        metric("metaros_unheard_of")
    with pytest.raises(KeyError):
        Families().put("metaros_unheard_of", 1)
