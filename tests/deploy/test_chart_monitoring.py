"""What the chart measures by exists: every metric and label of its alerts, its dashboard and its autoscaler."""

from __future__ import annotations

import json
import re
from collections.abc import Iterator
from typing import Any

import pytest

from gateway.identity.permissions import permission
from gateway.ops.metric_table import METRICS
from tests.support.deployment.helm import CHART, rendered

SHOWN = {
    name: {*row.labels, *(["le"] if name.endswith("_bucket") else [])}
    for row in METRICS
    for name in (
        [f"{row.shown}_{part}" for part in ("bucket", "sum", "count")] if row.kind == "histogram" else [row.shown]
    )
}
GIVEN = {"namespace", "service", "pod"}  # by Prometheus
SERIES = re.compile(r"\b(metaros_[a-z_]+)(?:\{([^}]*)\})?")


def expressions() -> Iterator[tuple[str, str]]:
    """Every expression of the chart, and where it stands."""
    (rule,) = rendered("all-on").of("PrometheusRule")
    for group in rule["spec"]["groups"]:
        for item in group["rules"]:
            yield item["alert"], item["expr"]
    for panel in dashboard()["panels"]:
        for target in panel["targets"]:
            yield panel["title"], target["expr"]
    for variable in dashboard()["templating"]["list"]:
        if variable["type"] == "query":
            yield variable["name"], variable["query"]


def dashboard() -> dict[str, Any]:
    """As Grafana's sidecar reads it."""
    (config,) = [item for item in rendered("all-on").of("ConfigMap") if "-dashboard" in item["metadata"]["name"]]
    assert config["metadata"]["labels"]["grafana_dashboard"] == "1"
    (text,) = config["data"].values()
    found: dict[str, Any] = json.loads(text)
    return found


def unknown(expression: str) -> list[str]:
    """Metrics and labels of an expression that the gateway does not have."""
    wrong = []
    for name, matchers in SERIES.findall(expression):
        if name not in SHOWN:
            wrong.append(name)
            continue
        labels = re.findall(r"([a-z_]+)(?:=~|=|!=)", matchers)
        wrong += [f"{name}{{{label}}}" for label in labels if label not in SHOWN[name] | GIVEN]
    return wrong


def test_every_metric_and_label_exists() -> None:
    found = list(expressions())
    assert len(found) > 25
    assert all("metaros_" in expression for _, expression in found)
    assert {where: unknown(expression) for where, expression in found if unknown(expression)} == {}


def test_what_is_grouped_by_exists() -> None:
    for where, expression in expressions():
        names = [name for name, _ in SERIES.findall(expression)]
        for words in re.findall(r"\b(?:by|on|ignoring) \(([^)]*)\)|ignoring\((\w+)\)", expression):
            for label in filter(None, re.split(r",\s*", words[0] or words[1])):
                assert any(label in SHOWN[name] | GIVEN for name in names), f"{where}: {label}"


@pytest.mark.parametrize(
    ("expression", "wrong"),
    [
        ("metaros_ready == 0", []),
        ("rate(metaros_link_samples[5m])", ["metaros_link_samples"]),
        ('metaros_robots{status="online"}', ["metaros_robots{status}"]),
        ("metaros_http_request_seconds", ["metaros_http_request_seconds"]),
    ],
)
def test_what_does_not_exist_would_be_noticed(expression: str, wrong: list[str]) -> None:
    assert unknown(expression) == wrong


def test_parentheses_and_templates_are_closed() -> None:
    for where, expression in expressions():
        for begin, end in ("()", "{}", "[]"):
            assert expression.count(begin) == expression.count(end), where
        assert expression.count('"') % 2 == 0
        assert "{{" not in expression
        assert "%!" not in expression
    (rule,) = rendered("all-on").of("PrometheusRule")
    texts = [item["annotations"]["summary"] for item in rule["spec"]["groups"][0]["rules"]]
    assert any("{{ $labels.pod }}" in text for text in texts)


def test_the_autoscalers_metric_exists() -> None:
    (scaler,) = rendered("all-on").of("HorizontalPodAutoscaler")
    metric = scaler["spec"]["metrics"][1]["pods"]["metric"]
    assert metric["selector"]["matchLabels"].keys() <= SHOWN[metric["name"]]


def test_prometheus_finds_every_process_and_has_a_key() -> None:
    found = rendered("existing-secrets")
    (monitor,) = found.of("ServiceMonitor")
    selector = monitor["spec"]["selector"]["matchLabels"]
    (service,) = [item for item in found.of("Service") if selector.items() <= item["metadata"]["labels"].items()]
    (endpoint,) = monitor["spec"]["endpoints"]
    assert endpoint["port"] in {port["name"] for port in service["spec"]["ports"]}
    assert (service["spec"]["clusterIP"], service["spec"]["publishNotReadyAddresses"]) == ("None", True)
    assert permission("metrics.read").who != "anyone"
    assert endpoint["authorization"]["credentials"] == {"name": "prometheus-key", "key": "key"}
    names = found.gateway()["args"]
    assert endpoint["tlsConfig"]["serverName"] in names
    assert endpoint["tlsConfig"]["ca"] == {"configMap": {"name": "gateway-ca", "key": "ca.crt"}}
    (plain,) = rendered("proxy").of("ServiceMonitor")
    assert plain["spec"]["endpoints"][0]["scheme"] == "http"
    (rule,) = rendered("all-on").of("PrometheusRule")
    assert 'service="fleet-fleet-gateway-metrics"' in rule["spec"]["groups"][0]["rules"][0]["expr"]


def test_the_dashboard_is_one_that_grafana_reads() -> None:
    found = json.loads((CHART / "dashboards" / "metaros.json").read_text())
    assert found == dashboard()
    numbers = [panel["id"] for panel in found["panels"]]
    assert len(set(numbers)) == len(numbers)
    assert all(panel["targets"] and panel["title"] for panel in found["panels"])
    places = [(panel["gridPos"]["x"], panel["gridPos"]["y"]) for panel in found["panels"]]
    assert len(set(places)) == len(places)
