"""The values: none that is misspelt or does not fit gets through, and what cannot work is said before it is there."""

from __future__ import annotations

import json
import re
from collections.abc import Iterator
from typing import Any

import jsonschema
import yaml

from metaros.limits import LIMITS
from tests.support.deployment.helm import CHART, HELMS, SETS, notes, rendered, run_helm, settings_file

SCHEMA = json.loads((CHART / "values.schema.json").read_text())
CHECK = jsonschema.Draft7Validator(SCHEMA)
VALUES = yaml.safe_load((CHART / "values.yaml").read_text())
OPEN = {"affinity"}  # objects of Kubernetes, which knows them better
DATABASE = "database.existingSecret=db"
SHARED = f"{DATABASE},objects.url=s3://b,masterKey.existingSecret=m"


def objects_in(schema: Any, path: str = "") -> Iterator[tuple[str, dict[str, Any]]]:
    """Every schema of an object, and where it stands."""
    if isinstance(schema, dict):
        if "properties" in schema:
            yield path, schema
        for key, value in schema.items():
            yield from objects_in(value, f"{path}/{key}")
    elif isinstance(schema, list):
        for place, value in enumerate(schema):
            yield from objects_in(value, f"{path}/{place}")


def resolved(schema: dict[str, Any]) -> dict[str, Any]:
    """A schema, or the one that it refers to."""
    if "$ref" in schema:
        found: dict[str, Any] = SCHEMA["definitions"][schema["$ref"].rpartition("/")[2]]
        return found
    return schema


def paths_of(values: Any, schema: dict[str, Any], path: str = "") -> Iterator[tuple[str, Any, dict[str, Any]]]:
    """Every value that has a default: where it is, the default and its schema."""
    schema = resolved(schema)
    for key, value in values.items():
        own = schema["properties"].get(key)
        assert own is not None, f"the schema lacks {path}{key}"
        own = resolved(own)
        yield f"{path}{key}", value, own
        if isinstance(value, dict) and "properties" in own:
            yield from paths_of(value, own, f"{path}{key}.")


def test_the_schema_is_one_and_closed_at_every_level_of_ours() -> None:
    jsonschema.Draft7Validator.check_schema(SCHEMA)
    found = dict(objects_in(SCHEMA))
    assert len(found) > 40
    assert [path for path, schema in found.items() if schema.get("additionalProperties") is not False] == []


def test_every_default_has_a_schema_and_every_schema_a_default() -> None:
    known = {path for path, _, _ in paths_of(VALUES, SCHEMA)}

    def wanted(schema: dict[str, Any], path: str = "") -> Iterator[str]:
        for key, own in resolved(schema)["properties"].items():
            yield f"{path}{key}"
            if "$ref" not in own and own.get("type") == "object" and "properties" in own:
                yield from wanted(own, f"{path}{key}.")

    assert set(wanted(SCHEMA)) - known == set()
    for path, value, own in paths_of(VALUES, SCHEMA):
        CHECK.evolve(schema={**own, "definitions": SCHEMA["definitions"]}).validate(value)
        untyped = own == {"type": "object"} and path.rpartition(".")[2] not in OPEN
        assert not untyped or path == "global", f"{path} may be anything"


def test_bounds_are_the_gateways_own() -> None:
    workers = SCHEMA["properties"]["functions"]["properties"]["workers"]
    assert (workers["minimum"], workers["maximum"]) == (1, LIMITS.function_workers)
    drain = SCHEMA["properties"]["gateway"]["properties"]["drain"]["properties"]["seconds"]
    assert drain["maximum"] == 600
    levels = SCHEMA["properties"]["functions"]["properties"]["sandboxRequire"]["enum"]
    from gateway.settings import SANDBOXES

    assert tuple(levels) == SANDBOXES


WRONG: tuple[dict[str, Any], ...] = (
    {"replica": 3},
    {"replicas": 0},
    {"replicas": "3"},
    {"replicas": 2.5},
    {"nameOverride": "x" * 41},
    {"commonLabels": {"a": 1}},
    {"image": {"digest": "sha256:abc"}},
    {"image": {"digest": "latest"}},
    {"image": {"repository": ""}},
    {"image": {"tag": "a b"}},
    {"image": {"pullPolicy": "Sometimes"}},
    {"image": {"name": "metaros"}},
    {"imagePullSecrets": ["registry"]},
    {"imagePullSecrets": [{"name": ""}]},
    {"serviceAccount": {"token": True}},
    {"serviceAccount": {"annotations": {"a": True}}},
    {"database": {"url": "postgresql://u:p@h/d"}},
    {"database": {"password": "x"}},
    {"database": {"existingSecret": "Big Name"}},
    {"database": {"key": ""}},
    {"objects": {"url": "https://bucket"}},
    {"objects": {"url": "s3://key:secret@bucket"}},
    {"objects": {"secretKey": "x"}},
    {"masterKey": {"value": "x"}},
    {"persistence": {"size": "10 GB"}},
    {"persistence": {"enabled": "yes"}},
    {"tls": {"mode": "off"}},
    {"tls": {"trustedProxies": ["ingress-nginx"]}},
    {"tls": {"trustedProxies": "10.0.0.0/8"}},
    {"certificate": {"issuerRef": {"names": "a"}}},
    {"certificate": {"duration": "90 days"}},
    {"gateway": {"host": "fleet.example.org"}},
    {"gateway": {"hosts": ["https://fleet.example.org"]}},
    {"gateway": {"hosts": ["*.example.org"]}},
    {"gateway": {"origins": ["fleet.example.org"]}},
    {"gateway": {"fleet": "Plant 1"}},
    {"gateway": {"robotCertificateHours": 23}},
    {"gateway": {"robotCertificateHours": 169}},
    {"gateway": {"heartbeatSeconds": 0.1}},
    {"gateway": {"retention": {"mib": 0}}},
    {"gateway": {"retention": {"days": 0}}},
    {"gateway": {"retention": {"rules": ["images=3d"]}}},
    {"gateway": {"limits": {"requestsPerSecond": -1}}},
    {"gateway": {"limits": {"robotBytesPerSecond": "64Mi"}}},
    {"gateway": {"drain": {"seconds": 601}}},
    {"gateway": {"drain": {"preStopSeconds": "5s"}}},
    {"gateway": {"log": {"level": "trace"}}},
    {"gateway": {"log": {"format": "logfmt"}}},
    {"gateway": {"otlp": "collector:4318"}},
    {"gateway": {"ports": {"http": 0}}},
    {"gateway": {"ports": {"http": 70000}}},
    {"gateway": {"ports": {"grpc": 8081}}},
    {"gateway": {"extraArgs": "--tick-ms 10"}},
    {"gateway": {"extraEnv": {"A": "b"}}},
    {"gateway": {"resources": {"memory": "1Gi"}}},
    {"gateway": {"topologySpread": {"whenUnsatisfiable": "Never"}}},
    {"gateway": {"securityContext": {"runAsUser": 0}}},
    {"functions": {"sandboxRequire": "L4"}},
    {"functions": {"workers": 65}},
    {"functions": {"egress": ""}},
    {"functions": {"runners": {"replicas": 0}}},
    {"zenoh": {"replicas": 0}},
    {"zenoh": {"endpoints": ["udp/router:7447"]}},
    {"zenoh": {"endpoints": ["router:7447"]}},
    {"zenoh": {"loadBalancer": {"sourceRanges": ["everybody"]}}},
    {"migrations": {"backoffLimit": -1}},
    {"autoscaling": {"minReplicas": 0}},
    {"autoscaling": {"targetCPUUtilizationPercentage": 101}},
    {"autoscaling": {"connectedRobots": {"targetAverage": 0}}},
    {"podDisruptionBudget": {"minAvailable": "half"}},
    {"podDisruptionBudget": {"minAvailable": -1}},
    {"podDisruptionBudget": {"minAvalable": 1}},
    {"networkPolicy": {"from": {"htttp": []}}},
    {"networkPolicy": {"egress": {"database": {"port": "5432"}}}},
    {"networkPolicy": {"egress": {"public": {"except": ["private"]}}}},
    {"service": {"type": "ExternalName"}},
    {"service": {"robots": {"port": 8081}}},
    {"ingress": {"hosts": ["fleet.example.org"]}},
    {"ingress": {"annotations": {"a": 3600}}},
    {"gatewayApi": {"parentRefs": [{"namespace": "a"}]}},
    {"gatewayApi": {"robots": {"apiVersion": "v1"}}},
    {"metrics": {"serviceMonitor": {"interval": "15"}}},
    {"metrics": {"prometheusRule": {"lagSeconds": 0}}},
    {"postgresql": {"enabled": True}},
    {"postgresql": {"nonProduction": {"password": "x"}}},
)


def test_a_value_that_is_wrong_is_refused() -> None:
    assert [wrong for wrong in WRONG if CHECK.is_valid(wrong)] == []


def test_the_sets_fit() -> None:
    for name in SETS:
        CHECK.validate(yaml.safe_load(settings_file(name).read_text()))


def test_helm_asks_the_schema() -> None:
    """Each value in a way of its own: it says all that it finds at once."""
    wrong = ("replica=3", "gateway.drain.seconds=601", "tls.mode=off", "objects.url=s3://key:secret@bucket")
    for version in HELMS:
        done = run_helm(version, "template", "x", CHART, "--set", ",".join(wrong))
        assert done.returncode != 0
        said = done.stderr
        assert [one for one in wrong if one.partition("=")[0].rpartition(".")[2] not in said] == []


GUARDS = (
    ("podDisruptionBudget.minAvailable=1,podDisruptionBudget.maxUnavailable=1", "not both"),
    (f"{SHARED},replicas=3,podDisruptionBudget.minAvailable=3", "no node could ever be drained"),
    (f"{SHARED},autoscaling.enabled=true,podDisruptionBudget.minAvailable=2", "no node could ever be drained"),
    (f"{SHARED},replicas=3,podDisruptionBudget.minAvailable=100%", "no node could ever be drained"),
    (f"{SHARED},replicas=3,podDisruptionBudget.maxUnavailable=0", "no node could ever be drained"),
    ("replicas=2", "needs database.existingSecret"),
    ("autoscaling.enabled=true", "needs database.existingSecret"),
    ("functions.runners.enabled=true", "needs database.existingSecret"),
    (f"replicas=2,{DATABASE}", "needs objects.url"),
    (f"replicas=2,{DATABASE},objects.url=s3://b", "needs masterKey.existingSecret"),
    (f"replicas=2,{SHARED},zenoh.enabled=false", "needs zenoh.enabled or zenoh.endpoints"),
    (f"{SHARED},autoscaling.enabled=true,autoscaling.minReplicas=7", "is over autoscaling.maxReplicas"),
    (f"{DATABASE},postgresql.nonProduction.enabled=true", "one database, not two"),
    ("postgresql.nonProduction.enabled=true", "the secret with its password"),
    ("objects.url=s3://b,persistence.enabled=false", "would outlive"),
    ("ingress.enabled=true,ingress.host=a.b,gatewayApi.enabled=true", "one way in, not both"),
    ("ingress.enabled=true", "ingress.host"),
    ("ingress.enabled=true,ingress.host=a.b,ingress.grpc.host=a.b", "needs a host of its own"),
    ("gatewayApi.enabled=true,gatewayApi.host=a.b", "gatewayApi.parentRefs"),
    ("gatewayApi.enabled=true,gatewayApi.host=a.b,gatewayApi.parentRefs[0].name=g", "backendTLS.enabled"),
    (
        "gatewayApi.enabled=true,gatewayApi.host=a.b,gatewayApi.parentRefs[0].name=g,gatewayApi.backendTLS.enabled=true",
        "backendTLS.hostname",
    ),
    ("tls.mode=proxy", "needs tls.trustedProxies"),
    ("tls.mode=proxy,tls.trustedProxies={10.0.0.0/8},tls.existingSecret=a", "one of the two"),
    ("certificate.enabled=true,certificate.issuerRef.name=i,gateway.hosts={a.b},tls.existingSecret=a", "cert-manager"),
    ("certificate.enabled=true,certificate.issuerRef.name=i", "gateway.hosts"),
    (f"{SHARED},replicas=2,zenoh.loadBalancer.enabled=true", "sourceRanges"),
    ("functions.runners.enabled=true,functions.enabled=false", "without functions.enabled"),
    ("metrics.serviceMonitor.enabled=true", "needs a viewer's key"),
    ("gateway.ports.foxglove=8080", "is taken by another"),
)


def test_what_cannot_work_is_said() -> None:
    found = {options: run_helm(HELMS[-1], "template", "x", CHART, "--set", options) for options, _ in GUARDS}
    missed = {
        options: found[options].stdout + found[options].stderr
        for options, said in GUARDS
        if not found[options].returncode or said not in found[options].stderr
    }
    assert missed == {}


def test_every_guard_is_tried() -> None:
    text = (CHART / "templates" / "guards.yaml").read_text()
    words = re.findall(r'fail (?:\(printf )?"([^"]*)"', text)
    assert len(words) > 20
    untried = [word for word in words if not any(said in word for _, said in GUARDS)]
    assert untried == []


WARNINGS = (
    ("", ("replicas is 1", "no masterKey", "sandboxRequire is L0", "image.digest is empty")),
    ("persistence.enabled=false,networkPolicy.enabled=false", ("gone with the pod", "networkPolicy is off")),
    ("tls.mode=proxy,tls.trustedProxies={10.0.0.0/8}", ("in the open",)),
    ("ingress.enabled=true,ingress.host=a.b", ("ingress.tlsSecret is empty",)),
    (f"{SHARED},replicas=2,podDisruptionBudget.enabled=false", ("podDisruptionBudget is off",)),
    ("postgresql.nonProduction.enabled=true,postgresql.nonProduction.existingSecret=p", ("PostgreSQL without backup",)),
    ("gateway.bootstrapAdmin=false", ("bootstrapAdmin is off",)),
    (f"{SHARED},migrations.enabled=false", ("nobody makes the first administrator",)),
    (
        "metrics.serviceMonitor.enabled=true,metrics.serviceMonitor.existingSecret=k,"
        "metrics.serviceMonitor.insecureSkipVerify=true",
        ("gives its key",),
    ),
)


def test_what_is_unsafe_is_warned_of() -> None:
    missed = {}
    for options, said in WARNINGS:
        shown = notes(*(("--set", options) if options else ()))
        words = [word for word in said if not re.search(rf"WARNING .*{re.escape(word)}", shown)]
        if words or "Not yet for production:" not in shown:
            missed[options] = (words, shown)
    assert missed == {}


def test_a_good_installation_is_warned_of_nothing() -> None:
    shown = notes("-f", str(settings_file("ha")))
    assert "WARNING" not in shown
    assert "production" not in shown
    assert "https://fleet.example.org" in shown
    folder = re.search(r"metaros signin --data-dir (\S+)", shown)
    assert folder is not None
    assert folder[1] in rendered("ha").gateway()["args"]


def test_every_value_that_is_said_in_the_chart_exists() -> None:
    known = {path for path, _, _ in paths_of(VALUES, SCHEMA)}
    said = set()
    for path in sorted((CHART / "templates").rglob("*")):
        if path.is_file():
            said |= set(re.findall(r"(?:\$values|\.Values)\.([a-zA-Z.]*[a-zA-Z])", path.read_text()))
    assert len(said) > 60
    assert sorted(said - known) == []
