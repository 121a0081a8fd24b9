"""Every pod is what Kubernetes calls restricted, and no secret is in the chart but by its name."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import pytest

from tests.support.deployment.helm import SETS, parsed, rendered, settings_file, template

Object = dict[str, Any]
# https://kubernetes.io/docs/concepts/security/pod-security-standards/: what "restricted" lets a pod mount.
VOLUMES = {"configMap", "csi", "downwardAPI", "emptyDir", "ephemeral", "persistentVolumeClaim", "projected", "secret"}


def pods() -> Iterator[tuple[str, Object]]:
    """Every pod of every set."""
    for name in SETS:
        for owner, pod in rendered(name).pods():
            yield f"{name} {owner}", pod


def containers(pod: Object) -> list[Object]:
    """All of them."""
    return [*pod["spec"].get("initContainers", ()), *pod["spec"]["containers"]]


def test_every_pod_is_restricted() -> None:
    for owner, pod in pods():
        spec = pod["spec"]
        assert not {"hostNetwork", "hostPID", "hostIPC", "hostUsers", "shareProcessNamespace"} & spec.keys(), owner
        own = spec["securityContext"]
        assert (own["runAsNonRoot"], own["seccompProfile"]) == (True, {"type": "RuntimeDefault"}), owner
        assert own["runAsUser"] > 0
        assert own["runAsGroup"] > 0
        for volume in spec["volumes"]:
            assert volume.keys() - {"name"} <= VOLUMES, owner
        for container in containers(pod):
            assert container["securityContext"] == {
                "allowPrivilegeEscalation": False,
                "readOnlyRootFilesystem": True,
                "capabilities": {"drop": ["ALL"]},
            }, owner
            assert all("hostPort" not in port for port in container.get("ports", ()))


def test_no_pod_can_speak_to_the_api_server() -> None:
    for owner, pod in pods():
        assert pod["spec"]["automountServiceAccountToken"] is False, owner
        assert pod["spec"]["enableServiceLinks"] is False, owner
    accounts = [item for name in SETS for item in rendered(name).of("ServiceAccount")]
    assert accounts
    assert all(item["automountServiceAccountToken"] is False for item in accounts)


def test_every_pod_can_write_temporary_files_and_is_bounded() -> None:
    for owner, pod in pods():
        sizes = {volume["name"]: volume["emptyDir"] for volume in pod["spec"]["volumes"] if "emptyDir" in volume}
        assert all(bound["sizeLimit"] for bound in sizes.values()), owner
        for container in containers(pod):
            assert container["resources"]["limits"]["memory"], owner
            assert container["resources"]["requests"].keys() == {"cpu", "memory"}, owner
            assert "/tmp" in {mount["mountPath"] for mount in container["volumeMounts"]}, owner
            assert container["imagePullPolicy"] == "IfNotPresent"


def secret_names(item: Any) -> Iterator[str]:
    """Every secret that an object refers to."""
    if isinstance(item, dict):
        for key, value in item.items():
            if key in ("secretKeyRef", "credentials"):
                yield value["name"]
            elif key == "secretName":
                yield value
            elif key == "imagePullSecrets":
                yield from (one["name"] for one in value)
            else:
                yield from secret_names(value)
    elif isinstance(item, list):
        for value in item:
            yield from secret_names(value)


def test_secrets_are_named_and_none_is_made() -> None:
    for name in SETS:
        assert rendered(name).of("Secret") == []
    named = {one for item in rendered("existing-secrets").objects for one in secret_names(item)}
    assert named == {
        *("registry", "db", "s3", "master", "gateway-tls", "oidc", "notify", "issuer", "prometheus-key"),
    }
    named = {one for item in rendered("all-on").objects for one in secret_names(item)}
    assert {"fleet-fleet-gateway-tls", "fleet-tls", "grpc-tls"} <= named


def test_what_is_secret_is_never_a_value_in_the_environment() -> None:
    for owner, pod in pods():
        for container in containers(pod):
            for item in container.get("env", ()):
                secret = any(word in item["name"] for word in ("PASSWORD", "SECRET", "ACCESS_KEY"))
                if secret:
                    assert item["valueFrom"].keys() == {"secretKeyRef"}, owner
                if item["name"] == "METAROS_STORE" and "value" in item:
                    assert ":$(POSTGRES_PASSWORD)@" in item["value"]


def test_a_digest_pins_the_image_and_a_tag_does_not_matter_then() -> None:
    digest = "sha256:" + "0" * 64
    images = {item["image"] for _, pod in rendered("ha").pods() for item in containers(pod)}
    assert images == {f"registry.example.org/robots/metaros@{digest}"}
    found = parsed(template("-f", settings_file("default"), "--set", f"image.tag=old,image.digest={digest}"))
    assert found.gateway()["image"] == f"metaros@{digest}"
    assert rendered("default").gateway()["image"] == "metaros:2.0.0.dev1"
    assert rendered("all-on").gateway()["image"] == "registry.example.org/metaros:2.0.0"


def test_a_role_of_the_cloud_is_the_service_accounts() -> None:
    (account,) = rendered("ha").of("ServiceAccount")
    assert account["metadata"]["annotations"]["eks.amazonaws.com/role-arn"].startswith("arn:aws:iam::")
    spec = rendered("ha").one("Deployment", "fleet-metaros")["spec"]["template"]["spec"]
    assert spec["serviceAccountName"] == account["metadata"]["name"]
    assert "AWS_ACCESS_KEY_ID" not in {item["name"] for item in spec["containers"][0]["env"]}


def test_the_postgresql_of_the_chart_is_marked() -> None:
    found = [item for item in rendered("try-replicas").objects if item["metadata"]["name"].endswith("-postgresql")]
    assert {item["kind"] for item in found} == {"Service", "StatefulSet", "NetworkPolicy"}
    marked = [item for item in found if item["kind"] != "NetworkPolicy"]
    assert all(item["metadata"]["labels"]["metaros/non-production"] == "true" for item in marked)
    others = [item for name in SETS if name != "try-replicas" for item in rendered(name).objects]
    assert not any(item["metadata"]["name"].endswith("-postgresql") for item in others)


@pytest.mark.parametrize("name", SETS)
def test_every_object_has_the_labels_that_tools_look_for(name: str) -> None:
    for item in rendered(name).objects:
        if item["metadata"]["name"].endswith("-mine"):
            continue  # of extraObjects
        labels = item["metadata"]["labels"]
        wanted = {"name", "instance", "version", "managed-by", "part-of"}
        assert {f"app.kubernetes.io/{part}" for part in wanted} <= labels.keys()
        assert labels["helm.sh/chart"] == "metaros-0.1.0"
        assert (labels.get("team") == "robots") is (name == "all-on")
