"""Who reaches whom: selectors, services, network policies, the ways in, and how many there are."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import pytest

from tests.support.deployment.helm import NAMESPACE, SETS, Rendered, parsed, rendered, settings_file, template

COMPONENT = "app.kubernetes.io/component"
Object = dict[str, Any]


def selects(selector: Object, labels: Object) -> bool:
    """Whether a label selector takes a pod with these labels."""
    wanted = selector.get("matchLabels", {})
    among = selector.get("matchExpressions", ())
    assert all(item["operator"] == "In" for item in among)
    return all(labels.get(key) == value for key, value in wanted.items()) and all(
        labels.get(item["key"]) in item["values"] for item in among
    )


def ports_of(pod: Object) -> dict[str, int]:
    """Its containers' ports by name."""
    return {port["name"]: port["containerPort"] for item in pod["spec"]["containers"] for port in item.get("ports", ())}


def labels_of(pod: Object) -> Object:
    """Its labels."""
    labels: Object = pod["metadata"]["labels"]
    return labels


def opened(found: Rendered, pod: Object, direction: str) -> Iterator[Object]:
    """Every rule that lets something into a pod, or out of it."""
    for policy in found.of("NetworkPolicy"):
        spec = policy["spec"]
        if direction.capitalize() in spec["policyTypes"] and selects(spec["podSelector"], labels_of(pod)):
            yield from spec.get(direction, ())


def test_controllers_select_their_own_pods_and_no_others() -> None:
    for name in SETS:
        found = rendered(name)
        pods = dict(found.pods())
        for item in found.of("Deployment", "StatefulSet"):
            selector, own = item["spec"]["selector"], f"{item['kind']}/{item['metadata']['name']}"
            assert [owner for owner, pod in pods.items() if selects(selector, labels_of(pod))] == [own], name
            spread = item["spec"]["template"]["spec"].get("topologySpreadConstraints", ())
            assert all(constraint["labelSelector"] == selector for constraint in spread)
        for item in found.of("PodDisruptionBudget"):
            chosen = [owner for owner, pod in pods.items() if selects(item["spec"]["selector"], labels_of(pod))]
            assert len(chosen) == 1, name


def test_every_service_leads_to_ports_that_are_there() -> None:
    for name in SETS:
        found = rendered(name)
        for service in found.of("Service"):
            selector = {"matchLabels": service["spec"]["selector"]}
            behind = [pod for _, pod in found.pods() if selects(selector, labels_of(pod))]
            assert behind, f"{name}: {service['metadata']['name']} has nobody"
            for port in service["spec"]["ports"]:
                assert {ports_of(pod).get(port["targetPort"]) for pod in behind} == {port["port"]}, name


def test_every_port_of_a_gateway_is_behind_a_service() -> None:
    for name in SETS:
        found = rendered(name)
        served = {
            port["targetPort"]
            for service in found.of("Service")
            if service["spec"]["selector"].get(COMPONENT) == "gateway"
            for port in service["spec"]["ports"]
        }
        assert served == {port["name"] for port in found.gateway()["ports"]}, name


def test_nobody_connects_to_runners_but_prometheus() -> None:
    found = rendered("all-on")
    (pod,) = [pod for _, pod in found.pods() if labels_of(pod)[COMPONENT] == "runner"]
    leading = [
        service["metadata"]["name"]
        for service in found.of("Service")
        if selects({"matchLabels": service["spec"]["selector"]}, labels_of(pod))
    ]
    assert leading == ["fleet-fleet-gateway-metrics"]
    assert [port for rule in opened(found, pod, "ingress") for port in rule["ports"]] == [
        {"port": "http", "protocol": "TCP"}
    ]


@pytest.mark.parametrize("name", [name for name in SETS if name != "minimal"])
def test_nothing_is_open_but_every_port_that_a_pod_has(name: str) -> None:
    found = rendered(name)
    denying = found.one("NetworkPolicy", "-default-deny")["spec"]
    assert denying["policyTypes"] == ["Ingress", "Egress"]
    assert denying.keys() == {"podSelector", "policyTypes"}
    for owner, pod in found.pods():
        assert selects(denying["podSelector"], labels_of(pod)), owner
        into = {port["port"] for rule in opened(found, pod, "ingress") for port in rule["ports"]}
        component = labels_of(pod)[COMPONENT]
        assert into == ({"http"} if component == "runner" else set(ports_of(pod))), f"{name} {owner}"
        assert all(rule.get("ports") for rule in opened(found, pod, "egress")), f"{name} {owner}"


def test_every_way_out_that_a_pod_needs_is_open() -> None:
    for name in (name for name in SETS if name != "minimal"):
        found = rendered(name)
        for owner, pod in found.pods():
            out = {port["port"] for rule in opened(found, pod, "egress") for port in rule["ports"]}
            component = labels_of(pod)[COMPONENT]
            assert 53 in out, owner
            stored = any(item["name"] == "METAROS_STORE" for item in pod["spec"]["containers"][0].get("env", ()))
            assert bool({5432, "postgresql"} & out) is stored, f"{name} {owner}"
            if component in ("gateway", "runner"):
                assert 443 in out
                arguments = pod["spec"]["containers"][0]["args"]
                assert bool({"zenoh", 7447} & out) is ("--cluster" in arguments), f"{name} {owner}"
                assert (4318 in out) is ("--otlp" in arguments)
            if component == "test":
                assert {"http", "programs"} <= out


@pytest.mark.parametrize(
    ("url", "port"),
    [
        ("s3://fleet", 443),
        ("s3://fleet/a?region=eu-west-1", 443),
        ("s3://fleet?endpoint=https://minio.storage", 443),
        ("s3://fleet?endpoint=http://minio.storage&region=x", 80),
        ("s3://fleet/a?region=x&endpoint=https://minio.storage:9000", 9000),
        ("s3://fleet?endpoint=http://minio.storage:9001&region=x", 9001),
    ],
)
def test_the_object_stores_port_is_that_of_its_url(url: str, port: int) -> None:
    found = parsed(template("-f", settings_file("ha"), "--set", f"objects.url={url}"))
    rules = found.one("NetworkPolicy", "-metaros-egress")["spec"]["egress"]
    public, objects = (rule["ports"] for rule in rules[:2])
    assert (public, objects) == ([{"port": 443, "protocol": "TCP"}], [{"port": port, "protocol": "TCP"}])


def test_public_addresses_are_not_those_of_the_cluster() -> None:
    rules = rendered("default").one("NetworkPolicy", "-metaros-egress")["spec"]["egress"]
    (block,) = [peer["ipBlock"] for rule in rules for peer in rule.get("to", ()) if "ipBlock" in peer]
    assert block["cidr"] == "0.0.0.0/0"
    assert {"10.0.0.0/8", "169.254.0.0/16", "172.16.0.0/12", "192.168.0.0/16"} <= set(block["except"])


def test_who_is_named_may_connect_and_the_test_pod_too() -> None:
    found = rendered("all-on")
    (rule,) = found.one("NetworkPolicy", "-http")["spec"]["ingress"]
    assert [peer.keys() for peer in rule["from"]] == [{"namespaceSelector"}, {"podSelector"}]
    (test,) = [pod for _, pod in found.pods() if labels_of(pod)[COMPONENT] == "test"]
    assert selects(rule["from"][-1]["podSelector"], labels_of(test))
    (zenoh,) = found.one("NetworkPolicy", "-zenoh")["spec"]["ingress"]
    inside, *outside = zenoh["from"]
    pods = [pod for _, pod in found.pods() if selects(inside["podSelector"], labels_of(pod))]
    assert {labels_of(pod)[COMPONENT] for pod in pods} == {"gateway", "runner", "zenoh"}
    assert [peer["ipBlock"]["cidr"] for peer in outside] == ["192.0.2.0/24", "198.51.100.0/24"]


@pytest.mark.parametrize("metrics", ["", ",networkPolicy.from.metrics[0].ipBlock.cidr=192.0.2.8/32"])
def test_who_is_not_named_for_http_is_not_let_in_as_prometheus(metrics: str) -> None:
    asked = f"networkPolicy.from.http[0].ipBlock.cidr=192.0.2.7/32{metrics}"
    found = parsed(template("-f", settings_file("try-replicas"), "--set", asked))
    for owner, pod in found.pods():
        if labels_of(pod)[COMPONENT] in ("gateway", "runner"):
            rules = [
                rule for rule in opened(found, pod, "ingress") if {"port": "http", "protocol": "TCP"} in rule["ports"]
            ]
            peers = [peer for rule in rules for peer in rule["from"]]
            blocks = {peer["ipBlock"]["cidr"] for peer in peers if "ipBlock" in peer}
            assert blocks <= {"192.0.2.7/32", "192.0.2.8/32"}, owner
            assert ("192.0.2.8/32" in blocks) is bool(metrics), owner


def test_ways_in_lead_to_ports_of_services() -> None:
    for name in SETS:
        found = rendered(name)
        services = {item["metadata"]["name"]: item["spec"]["ports"] for item in found.of("Service")}
        for item in found.of("Ingress"):
            for rule in item["spec"]["rules"]:
                for path in rule["http"]["paths"]:
                    to = path["backend"]["service"]
                    assert to["port"]["name"] in {port["name"] for port in services[to["name"]]}
        for item in found.of("HTTPRoute", "GRPCRoute", "TLSRoute"):
            for rule in item["spec"]["rules"]:
                for to in rule["backendRefs"]:
                    assert to["port"] in {port["port"] for port in services[to["name"]]}
        for item in found.of("BackendTLSPolicy"):
            for to in item["spec"]["targetRefs"]:
                assert to["sectionName"] in {port["name"] for port in services[to["name"]]}


def test_what_speaks_tls_is_called_so() -> None:
    for name in SETS:
        found = rendered(name)
        plain = "--tls" in found.gateway()["args"]
        said = {
            port["targetPort"]: port["appProtocol"]
            for service in found.of("Service")
            for port in service["spec"]["ports"]
            if "appProtocol" in port
        }
        assert (said["http"], said["programs"], said["robots"]) == ("http" if plain else "https", "https", "https")
    notes = rendered("ha").one("Ingress", "fleet-metaros")["metadata"]["annotations"]
    assert notes["nginx.ingress.kubernetes.io/backend-protocol"] == "HTTPS"
    grpc = rendered("ha").one("Ingress", "-grpc")["metadata"]["annotations"]
    assert grpc["nginx.ingress.kubernetes.io/backend-protocol"] == "GRPCS"
    for kind in (notes, grpc):
        assert kind["nginx.ingress.kubernetes.io/proxy-read-timeout"] == "3600"
        assert kind["nginx.ingress.kubernetes.io/proxy-send-timeout"] == "3600"
    (rule,) = rendered("gateway-api").of("HTTPRoute")[0]["spec"]["rules"]
    assert rule["timeouts"]["request"] == "3600s"


def test_a_rollout_takes_no_gateway_away_before_another_is_ready() -> None:
    for name in SETS:
        for item in rendered(name).of("Deployment"):
            shared = any(env["name"] == "METAROS_STORE" for env in pod_env(item))
            strategy = item["spec"]["strategy"]
            if shared:
                assert strategy["rollingUpdate"] == {"maxUnavailable": 0, "maxSurge": 1}, name
            else:  # one data directory, one gateway
                assert (strategy, item["spec"]["replicas"]) == ({"type": "Recreate"}, 1), name


def pod_env(item: Object) -> list[Object]:
    """The environment of a deployment's container."""
    env: list[Object] = item["spec"]["template"]["spec"]["containers"][0]["env"]
    return env


def test_a_node_can_be_drained_and_somebody_stays() -> None:
    for name in SETS:
        found = rendered(name)
        counts = {item["metadata"]["name"]: least(found, item) for item in found.of("Deployment", "StatefulSet")}
        for budget in found.of("PodDisruptionBudget"):
            spec, count = budget["spec"], counts[budget["metadata"]["name"]]
            stay = spec.get("minAvailable", count - spec.get("maxUnavailable", 0))
            assert 1 <= stay < count, name
    assert rendered("minimal").of("PodDisruptionBudget") == []
    assert rendered("default").of("PodDisruptionBudget") == []
    assert rendered("ha").one("PodDisruptionBudget", "fleet-metaros")["spec"]["minAvailable"] == 2


def least(found: Rendered, item: Object) -> int:
    """How many of them there are at least."""
    for scaler in found.of("HorizontalPodAutoscaler"):
        if scaler["spec"]["scaleTargetRef"]["name"] == item["metadata"]["name"]:
            assert "replicas" not in item["spec"]  # who scales decides
            return int(scaler["spec"]["minReplicas"])
    return int(item["spec"]["replicas"])


def test_who_scales_looks_at_cpu_and_at_robots() -> None:
    (scaler,) = rendered("all-on").of("HorizontalPodAutoscaler")
    target = rendered("all-on").one("Deployment", scaler["spec"]["scaleTargetRef"]["name"])
    assert target["spec"]["template"]["spec"]["containers"][0]["resources"]["requests"]["cpu"]
    cpu, robots = scaler["spec"]["metrics"]
    assert (cpu["resource"]["name"], robots["pods"]["metric"]["name"]) == ("cpu", "metaros_robots")
    alone = parsed(template("-f", settings_file("ha"), "--set", "autoscaling.enabled=true,autoscaling.minReplicas=3"))
    assert [metric["type"] for metric in alone.of("HorizontalPodAutoscaler")[0]["spec"]["metrics"]] == ["Resource"]


def test_hooks_use_nothing_that_the_release_makes() -> None:
    for name in SETS:
        found = rendered(name)
        for job in found.of("Job"):
            assert job["metadata"]["annotations"]["helm.sh/hook"] == "pre-install,pre-upgrade"
            spec = job["spec"]["template"]["spec"]
            assert "serviceAccountName" not in spec
            assert all(volume.keys() == {"name", "emptyDir"} for volume in spec["volumes"])
        made = {item["metadata"]["name"] for item in found.of("Secret", "ConfigMap")}
        assert not any(ref in made for job in found.of("Job") for ref in str(job).split("'"))
        assert NAMESPACE not in {item["metadata"].get("namespace") for item in found.objects}


def test_names_are_short_enough_however_long_the_release_is_called() -> None:
    found = parsed(template("-f", settings_file("try-replicas"), "--set", f"fullnameOverride={'x' * 40}"))
    names = [(item["kind"], item["metadata"]["name"]) for item in found.objects]
    assert len(set(names)) == len(names)
    assert max(len(f"{name}-0") for _, name in names) <= 63
