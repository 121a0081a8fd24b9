"""The chart as Helm renders it: every set of values once a process, and what is in it by kind."""

from __future__ import annotations

import functools
import os
import subprocess
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import pytest
import yaml

from tools.helm import VERSIONS, helm, runs_here

__all__ = [
    "CHART",
    "HELMS",
    "KUBES",
    "NAMESPACE",
    "RELEASE",
    "SETS",
    "Rendered",
    "notes",
    "rendered",
    "run_helm",
    "settings_file",
    "template",
]

ROOT = Path(__file__).resolve().parents[3]
CHART = ROOT / "deploy" / "k8s"
SETS = tuple(sorted(path.stem for path in (CHART / "ci").glob("*.yaml")))
KUBES = ("1.30.0", "1.34.0", "1.37.0")
HELMS = VERSIONS
RELEASE, NAMESPACE = "fleet", "robots"
Object = dict[str, Any]


class _Strict(yaml.CSafeLoader):
    """Refuses a key that stands twice, as the API server does and YAML's parsers do not."""

    def construct_mapping(self, node: yaml.MappingNode, deep: bool = False) -> dict[Any, Any]:
        keys = [key.value for key, _ in node.value]
        twice = {key for key in keys if keys.count(key) > 1}
        if twice:
            raise AssertionError(f"twice in one mapping: {sorted(twice)}, {node.start_mark}")
        return super().construct_mapping(node, deep)


@dataclass(frozen=True, slots=True)
class Rendered:
    """The objects of one rendering."""

    objects: tuple[Object, ...]

    def of(self, *kinds: str) -> list[Object]:
        """Those of some kinds."""
        return [item for item in self.objects if item["kind"] in kinds]

    def one(self, kind: str, name: str) -> Object:
        """The one whose name ends so, after the release's."""
        (found,) = [item for item in self.of(kind) if item["metadata"]["name"].endswith(name)]
        return found

    def pods(self) -> Iterator[tuple[str, Object]]:
        """Every pod that would run: whose it is, and its template."""
        for item in self.objects:
            name = f"{item['kind']}/{item['metadata']['name']}"
            if item["kind"] in ("Deployment", "StatefulSet", "Job"):
                yield name, item["spec"]["template"]
            elif item["kind"] == "Pod":
                yield name, item

    def gateway(self, component: str = "gateway") -> Object:
        """The container of gateways, or of function runners."""
        for _, pod in self.pods():
            if pod["metadata"]["labels"]["app.kubernetes.io/component"] == component:
                return dict(pod["spec"]["containers"][0])
        raise AssertionError(f"there is no {component}")


def run_helm(version: str, *arguments: str | Path) -> subprocess.CompletedProcess[str]:
    """A command of Helm, which finds no cluster and nobody's settings."""
    if not runs_here():
        pytest.skip("Helm comes from a package for Linux on x86-64")
    try:
        program = helm(version)
    except RuntimeError as error:
        if os.environ.get("CI"):
            raise
        pytest.skip(str(error))
    home = program.parent / "home"
    environ = {"PATH": os.environ["PATH"], "HOME": str(home), "KUBECONFIG": str(home / "none")}
    environ["GOGC"] = "off"  # it ends before its garbage would be felt, and to collect that is a third of its time
    command = [str(program), *map(str, arguments)]
    return subprocess.run(command, capture_output=True, text=True, env=environ, timeout=120)


def settings_file(name: str) -> Path:
    """The file of a set of values."""
    return CHART / "ci" / f"{name}.yaml"


def template(*options: str | Path, kube: str = KUBES[-1], version: str = HELMS[-1]) -> str:
    """What Helm renders; AssertionError with its words when it does not."""
    done = run_helm(version, "template", RELEASE, CHART, "-n", NAMESPACE, "--kube-version", kube, *options)
    assert done.returncode == 0, done.stderr
    return done.stdout


def parsed(text: str) -> Rendered:
    """The objects of a text of many YAML documents."""
    documents = yaml.load_all(text, Loader=_Strict)
    return Rendered(tuple(document for document in documents if document is not None))


@functools.cache
def rendered(name: str, kube: str = KUBES[-1], version: str = HELMS[-1]) -> Rendered:
    """A set of values, rendered once."""
    return parsed(template("-f", settings_file(name), kube=kube, version=version))


@functools.cache
def notes(*options: str) -> str:
    """What is shown after an installation."""
    done = run_helm(HELMS[-1], "install", RELEASE, CHART, "-n", NAMESPACE, "--dry-run=client", *options)
    assert done.returncode == 0, done.stderr
    return done.stdout.partition("\nNOTES:\n")[2]
