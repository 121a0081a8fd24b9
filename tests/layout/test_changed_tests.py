"""`make test CHANGED=1`: what a change can break comes first, and what it cannot is not chosen."""

from __future__ import annotations

from pathlib import Path

import pytest

from tools.changed_tests import FURTHEST, Graph, imported_by, module_name, rank

ROOT = Path(__file__).resolve().parents[2]


@pytest.fixture(scope="module")
def graph() -> Graph:
    return Graph(ROOT)


def test_a_modules_own_test_comes_first_and_then_who_imports_it(graph: Graph) -> None:
    ranked = rank(["metaros/automation/rules/schedule.py"], graph)
    assert ranked[0] == (0, "tests/metaros/automation/rules/test_schedule.py")
    steps = {test: count for count, test in ranked}
    assert steps["tests/gateway/automation/rules/test_scheduler.py"] > 0
    assert "tests/metaros/cdr/test_codec.py" not in steps
    assert max(steps.values()) <= FURTHEST


def test_a_helper_of_tests_brings_the_tests_that_use_it(graph: Graph) -> None:
    found = {test for _, test in rank(["tests/support/servers/seaweed.py"], graph)}
    assert "tests/gateway/store/objects/test_s3.py" in found


def test_what_is_no_python_brings_the_folder_that_looks_after_it(graph: Graph) -> None:
    chart = {test for _, test in rank(["deploy/k8s/values.yaml"], graph)}
    assert "tests/deploy/test_chart.py" in chart
    assert "tests/layout/test_docs.py" in {test for _, test in rank(["docs/howto/topics.md"], graph)}


def test_every_product_module_has_a_test_within_reach(graph: Graph) -> None:
    from tools.changed_tests import ALWAYS

    def reached(module: str) -> bool:
        path = module.replace(".", "/")
        return len(rank([f"{path}.py"], graph)) > len(ALWAYS) or len(rank([f"{path}/__init__.py"], graph)) > len(ALWAYS)

    small = [name for name in graph.importers if name.startswith(("gateway.alerting.anomaly.", "edge_agent.outbox."))]
    assert len(small) > 20
    assert [name for name in sorted(small) if not reached(name)] == []


def test_a_package_is_called_by_its_folder() -> None:
    assert module_name("gateway/api/__init__.py") == "gateway.api"
    assert module_name("gateway/app.py") == "gateway.app"


def test_imports_are_read_wherever_they_stand() -> None:
    text = """
import os, a.b as c
from d import (
    e,  # why
    f as g,
)
def later():
    from h.i import j, k  # why
"""
    assert list(imported_by(text)) == ["os", "a.b", "d.e", "d.f", "h.i.j", "h.i.k"]
