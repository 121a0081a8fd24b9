"""docs/howto/kubernetes.md: its values fit, its commands are ours, and what they name is what the chart makes."""

from __future__ import annotations

import itertools
import re
import shlex
from pathlib import Path

import jsonschema
import yaml

from tests.deploy.test_chart_gateway import command_of
from tests.deploy.test_chart_values import SCHEMA, VALUES, paths_of
from tests.support.deployment.helm import CHART, NAMESPACE, RELEASE, parsed, rendered, settings_file, template

PAGE = CHART.parents[1] / "docs" / "howto" / "kubernetes.md"
TEXT = PAGE.read_text()


def blocks(language: str) -> list[str]:
    """The page's blocks of a language."""
    return re.findall(rf"^```{language}\n(.*?)^```", TEXT, re.DOTALL | re.MULTILINE)


def lines() -> list[list[str]]:
    """Every command of the page, as a shell takes it apart."""
    joined = "\n".join(blocks("sh")).replace("\\\n", " ")
    return [shlex.split(line) for line in joined.splitlines() if line]


def test_the_values_fit_and_render(tmp_path: Path) -> None:
    first, second = blocks("yaml")
    for block in (first, second):
        jsonschema.validate(yaml.safe_load(block), SCHEMA)
    file = tmp_path / "values.yaml"
    file.write_text(first + second)
    found = parsed(template("-f", file))
    assert {item["kind"] for item in found.objects} >= {"Ingress", "Job", "ServiceMonitor", "PrometheusRule"}
    ours = yaml.safe_load(settings_file("ha").read_text())
    for key in ("replicas", "database", "objects", "masterKey", "functions", "podDisruptionBudget"):
        assert yaml.safe_load(first)[key] == ours[key]


def test_every_value_that_is_named_exists() -> None:
    known = {path for path, _, _ in paths_of(VALUES, SCHEMA)}
    groups = "|".join(key for key in VALUES if key not in ("service", "global"))
    named = re.findall(rf"`((?:{groups}|service\.robots)\.[a-zA-Z.]+)", TEXT)
    assert len(named) > 10
    assert [name for name in named if name not in known] == []
    given = [value for line in lines() for flag, value in itertools.pairwise(line) if flag == "--set"]
    assert [value for value in given if value.partition("=")[0] not in known] == []


def test_the_commands_in_the_pods_are_ours() -> None:
    commands = [line[line.index("metaros") :] for line in lines() if "exec" in line and "metaros" in line]
    assert len(commands) >= 3
    folder = rendered("ha").gateway()["args"][rendered("ha").gateway()["args"].index("--data-dir") + 1]
    for command in commands:
        command_of(command[1:])
        assert command[command.index("--data-dir") + 1] == folder


def test_what_is_named_is_made() -> None:
    kinds = {"deploy": "Deployment", "service": "Service", "job": "Job"}
    made = {f"{item['kind']}/{item['metadata']['name']}" for item in rendered("ha").objects}
    named = re.findall(r"\b(deploy|service|job)/(fleet-[a-z0-9-]+)", "\n".join(blocks("sh")) + TEXT.rpartition("##")[2])
    assert len(named) >= 5
    assert {f"{kinds[kind]}/{name}" for kind, name in named} <= made
    for line in lines():
        if line[0] in ("helm", "kubectl") and line[1] not in ("create",):
            assert line[line.index("-n") + 1] == NAMESPACE, line
        if line[0] == "helm":
            assert line[2] == RELEASE
