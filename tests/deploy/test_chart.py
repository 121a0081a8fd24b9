"""The chart as Helm 3 and 4 see it: every set of values, on the oldest, a middle and the newest Kubernetes."""

from __future__ import annotations

import copy
import io
import tarfile
from pathlib import Path
from typing import Any

import jsonschema
import kubernetes_validate
import pytest
import yaml

from tests.support.deployment.helm import CHART, HELMS, KUBES, SETS, rendered, run_helm, settings_file
from tests.support.deployment.kubernetes import CUSTOM, check_object
from tests.support.tables import refusal


def test_there_are_sets_for_every_way_to_install_it() -> None:
    assert {"default", "minimal", "ha", "all-on", "existing-secrets", "no-ingress", "gateway-api"} <= set(SETS)
    assert len(KUBES) == 3
    assert [version.split(".")[0] for version in HELMS] == ["3", "4"]


@pytest.mark.integration
def test_helm_finds_nothing_to_complain_of() -> None:
    # The older Helm renders every set below; what more it looks at is the same in all of them.
    cases = [(HELMS[-1], name) for name in SETS] + [(version, "all-on") for version in HELMS[:-1]]
    complaints = {}
    for version, name in cases:
        done = run_helm(version, "lint", "--strict", CHART, "-f", settings_file(name), "--kube-version", KUBES[0])
        said = done.stdout + done.stderr
        if done.returncode or "1 chart(s) linted, 0 chart(s) failed" not in said:
            complaints[version, name] = said
    assert complaints == {}


@pytest.mark.parametrize("kube", KUBES)
def test_kubernetes_takes_every_object(kube: str) -> None:
    complaints = {}
    for name in SETS:
        found = rendered(name)
        assert found.of("Deployment")
        for item in found.objects:
            if said := refusal(jsonschema.ValidationError, check_object, item, kube):
                complaints[name, item["kind"], item["metadata"]["name"]] = said
    assert complaints == {}


def test_every_kubernetes_gets_the_same() -> None:
    """The templates do not ask for its version: what is looked at for the newest is so for all."""
    texts = {str(path.relative_to(CHART)): path.read_text() for path in CHART.rglob("*") if path.is_file()}
    assert [name for name, text in texts.items() if "Capabilities" in text] == []
    for kube in KUBES:
        assert str(rendered("all-on", kube).objects) == str(rendered("all-on").objects)


@pytest.mark.parametrize("name", SETS)
def test_helm_3_and_4_render_the_same(name: str) -> None:
    old, new = (sorted(map(str, rendered(name, version=version).objects)) for version in HELMS)
    assert old == new


def test_an_older_kubernetes_is_refused() -> None:
    for version in HELMS:
        done = run_helm(version, "template", "x", CHART, "--kube-version", "1.29.9")
        assert done.returncode != 0
        assert "kubeVersion" in done.stderr


def test_every_kind_of_object_is_rendered_by_some_set() -> None:
    kinds = {item["kind"] for name in SETS for item in rendered(name).objects}
    own = {"ConfigMap", "Deployment", "HorizontalPodAutoscaler", "Ingress", "Job", "NetworkPolicy", "Pod"}
    own |= {"PersistentVolumeClaim", "PodDisruptionBudget", "Service", "ServiceAccount", "StatefulSet"}
    assert kinds == own | set(CUSTOM)


def test_every_set_renders_something_of_its_own() -> None:
    assert len({str(rendered(name).objects) for name in SETS}) == len(SETS)


def broken(change: str) -> dict[str, Any]:
    """A gateway with one thing wrong."""
    item = copy.deepcopy(rendered("default").one("Deployment", "metaros"))
    container = item["spec"]["template"]["spec"]["containers"][0]
    if change == "misspelt":
        container["containerPortz"] = container.pop("ports")
    elif change == "type":
        item["spec"]["replicas"] = "three"
    else:
        item["spec"]["template"]["spec"]["terminationGracePeriod"] = 30
    return item


def test_the_schemas_would_notice() -> None:
    changes = ("misspelt", "type", "unknown")
    missed = [it for it in changes if not refusal(jsonschema.ValidationError, check_object, broken(it), KUBES[-1])]
    assert missed == []
    with pytest.raises(kubernetes_validate.SchemaNotFoundError):
        check_object({"apiVersion": "v1", "kind": "Gadget"}, KUBES[-1])


@pytest.mark.parametrize("kind", sorted(CUSTOM))
def test_our_own_schemas_would_notice(kind: str) -> None:
    (found, *_) = [item for name in SETS for item in rendered(name).of(kind)]
    item = copy.deepcopy(found)
    for where in (item, item["spec"]):
        where["surprise"] = 1
        with pytest.raises(jsonschema.ValidationError):
            check_object(item, KUBES[-1])
        del where["surprise"]
    check_object(item, KUBES[-1])


@pytest.mark.parametrize("version", HELMS)
def test_the_package_has_what_it_needs_and_nothing_else(tmp_path: Path, version: str) -> None:
    done = run_helm(version, "package", CHART, "-d", tmp_path)
    assert done.returncode == 0, done.stderr
    (package,) = tmp_path.iterdir()
    with tarfile.open(fileobj=io.BytesIO(package.read_bytes())) as archive:
        names = sorted(name.partition("/")[2] for name in archive.getnames())
    ours = {path.relative_to(CHART).as_posix() for path in CHART.rglob("*") if path.is_file()}
    assert set(names) == {name for name in ours if not name.startswith("ci/")}
    chart = yaml.safe_load((CHART / "Chart.yaml").read_text())
    assert package.name == f"metaros-{chart['version']}.tgz"


def test_the_chart_is_of_this_version_of_the_program() -> None:
    import tomllib

    project = tomllib.loads((CHART.parents[1] / "pyproject.toml").read_text())["project"]
    chart = yaml.safe_load((CHART / "Chart.yaml").read_text())
    assert chart["appVersion"] == project["version"]
    assert chart["kubeVersion"] == f">={'.'.join(KUBES[0].split('.')[:2])}.0-0"
    assert {"artifacthub.io/license", "artifacthub.io/changes"} <= chart["annotations"].keys()
