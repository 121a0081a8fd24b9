"""The alerts for Prometheus are of metrics and labels that the gateway has, and the how-to says what to do at each."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

import pytest
import yaml

from gateway.ops.metric_table import METRICS
from tests.support.tables import cases

ROOT = Path(__file__).resolve().parents[2]
PAGE = ROOT / "docs" / "howto" / "monitor_with_prometheus.md"
RULES: list[dict[str, Any]] = yaml.safe_load((ROOT / "deploy" / "prometheus" / "metaros.rules.yaml").read_text())[
    "groups"
][0]["rules"]
EXPRESSIONS = [rule["expr"] for rule in RULES]
TABLE = [
    found[1].replace("\\|", "|")
    for found in re.finditer(r"^\| [^|]+ \| `([^|]*metaros_[^|]*)` \|$", PAGE.read_text(), re.MULTILINE)
]
LABELS = {row.shown: {*row.labels, "instance", "job"} for row in METRICS}
LABELS |= {
    f"{row.name}_{part}": {*row.labels, "le", "instance", "job"}
    for row in METRICS
    if row.kind == "histogram"
    for part in ("bucket", "sum", "count")
}


@cases("expression", [*EXPRESSIONS, *TABLE])
def test_it_asks_for_metrics_and_labels_that_there_are(expression: str) -> None:
    names = re.findall(r"\bmetaros_\w+", expression)
    assert names or "up{" in expression
    assert [name for name in names if name not in LABELS] == []
    for name, selector in re.findall(r"\b(metaros_\w+)\{([^}]*)\}", expression):
        assert set(re.findall(r"(\w+)=", selector)) <= LABELS[name]
    for grouped in re.findall(r"(?:by|on|ignoring) \(([^)]*)\)", expression):
        assert set(grouped.split(", ")) <= set().union(*(LABELS[name] for name in names))
    for ranged in re.findall(r"(?:rate|increase)\((metaros_\w+)", expression):
        assert ranged.endswith(("_total", "_sum", "_count", "_bucket")), "of a counter"
    assert expression.count("(") == expression.count(")")


@pytest.mark.parametrize("rule", RULES, ids=[rule["alert"] for rule in RULES])
def test_it_says_how_bad_it_is_and_the_page_what_to_do(rule: dict[str, Any]) -> None:
    assert set(rule) <= {"alert", "expr", "for", "labels", "annotations"}
    assert rule["labels"]["severity"] in ("critical", "warning", "info")
    assert re.fullmatch(r"\d+m", rule.get("for", "0m"))
    assert rule["annotations"]["summary"]
    assert re.search(rf"^\| `{rule['alert']}` \| {rule['labels']['severity']} \| \S", PAGE.read_text(), re.MULTILINE)


def test_the_page_names_no_other() -> None:
    assert set(re.findall(r"^\| `(Metaros\w+)`", PAGE.read_text(), re.MULTILINE)) == {rule["alert"] for rule in RULES}


def test_the_charts_alerts_are_among_them() -> None:
    chart = (ROOT / "deploy" / "k8s" / "templates" / "monitoring.yaml").read_text()
    assert set(re.findall(r"- alert: (\w+)", chart)) <= {rule["alert"] for rule in RULES}
