"""Kubernetes' own schemas, and small ones of ours for kinds that other projects bring."""

from __future__ import annotations

import functools
import json
from typing import Any

import jsonschema
import kubernetes_validate

__all__ = ["CUSTOM", "check_object"]

TEXT: dict[str, Any] = {"type": "string", "minLength": 1}
PORT: dict[str, Any] = {"type": "integer", "minimum": 1, "maximum": 65535}
META: dict[str, Any] = {"type": "object", "required": ["name", "labels"]}
LABELS: dict[str, Any] = {"type": "object", "additionalProperties": {"type": "string"}}


def closed(*required: str, **properties: Any) -> dict[str, Any]:
    """An object with these properties and no others."""
    known = {"type": "object", "additionalProperties": False, "properties": properties}
    return {**known, "required": list(required)}


def several(item: dict[str, Any]) -> dict[str, Any]:
    """One of them or more."""
    return {"type": "array", "minItems": 1, "items": item}


def custom(api_version: dict[str, Any], kind: str, spec: dict[str, Any]) -> dict[str, Any]:
    """A whole object."""
    return closed(
        "apiVersion", "kind", "metadata", "spec", apiVersion=api_version, kind={"const": kind}, metadata=META, spec=spec
    )


SELECTOR = closed("matchLabels", matchLabels=LABELS)
NAMED = closed("name", "key", name=TEXT, key=TEXT)
PARENT = closed("name", name=TEXT, namespace=TEXT, sectionName=TEXT, port=PORT, group=TEXT, kind=TEXT)
BACKEND = closed("name", "port", name=TEXT, port=PORT)
REFERENCE = closed("group", "kind", "name", group={"type": "string"}, kind=TEXT, name=TEXT, sectionName=TEXT)
GATEWAY_API = "gateway.networking.k8s.io/"
ENDPOINT = closed(
    *("port", "path", "scheme", "authorization"),
    port=TEXT,
    path={"const": "/metrics"},
    scheme={"enum": ["http", "https"]},
    interval=TEXT,
    authorization=closed("type", "credentials", type={"const": "Bearer"}, credentials=NAMED),
    tlsConfig=closed(serverName=TEXT, insecureSkipVerify={"type": "boolean"}, ca=closed("configMap", configMap=NAMED)),
)
RULE = closed(
    *("alert", "expr", "labels", "annotations"),
    **{"alert": TEXT, "expr": TEXT, "for": {"pattern": "^[0-9]+m$"}},
    labels=closed("severity", severity={"enum": ["critical", "warning", "info"]}),
    annotations=closed("summary", summary=TEXT),
)
ROUTE_RULE = closed(
    "backendRefs",
    matches=several(closed("path", path=closed("type", "value", type={"const": "PathPrefix"}, value={"const": "/"}))),
    backendRefs=several(BACKEND),
    timeouts=closed(request={"pattern": "^[0-9]+s$"}, backendRequest={"pattern": "^[0-9]+s$"}),
)
GRPC_RULE = closed("backendRefs", backendRefs=several(BACKEND))


def route(rule: dict[str, Any]) -> dict[str, Any]:
    """What every kind of route is."""
    return closed(
        *("parentRefs", "hostnames", "rules"),
        parentRefs=several(PARENT),
        hostnames=several(TEXT),
        rules=several(rule),
    )


CUSTOM: dict[str, dict[str, Any]] = {
    "ServiceMonitor": custom(
        {"const": "monitoring.coreos.com/v1"},
        "ServiceMonitor",
        closed(
            *("selector", "namespaceSelector", "endpoints"),
            selector=SELECTOR,
            namespaceSelector=closed("matchNames", matchNames=several(TEXT)),
            endpoints=several(ENDPOINT),
        ),
    ),
    "PrometheusRule": custom(
        {"const": "monitoring.coreos.com/v1"},
        "PrometheusRule",
        closed("groups", groups=several(closed("name", "rules", name=TEXT, rules=several(RULE)))),
    ),
    "HTTPRoute": custom({"const": f"{GATEWAY_API}v1"}, "HTTPRoute", route(ROUTE_RULE)),
    "GRPCRoute": custom({"const": f"{GATEWAY_API}v1"}, "GRPCRoute", route(GRPC_RULE)),
    "TLSRoute": custom({"pattern": f"^{GATEWAY_API}v1(alpha[23])?$"}, "TLSRoute", route(GRPC_RULE)),
    "BackendTLSPolicy": custom(
        {"pattern": f"^{GATEWAY_API}v1(alpha3)?$"},
        "BackendTLSPolicy",
        closed(
            *("targetRefs", "validation"),
            targetRefs=several(REFERENCE),
            validation=closed(
                "hostname",
                hostname=TEXT,
                caCertificateRefs=several(REFERENCE),
                wellKnownCACertificates={"const": "System"},
            ),
        ),
    ),
    "Certificate": custom(
        {"const": "cert-manager.io/v1"},
        "Certificate",
        closed(
            *("secretName", "dnsNames", "issuerRef"),
            secretName=TEXT,
            dnsNames=several(TEXT),
            duration={"pattern": "^[0-9]+h$"},
            renewBefore={"pattern": "^[0-9]+h$"},
            privateKey=closed(algorithm={"const": "ECDSA"}, size={"const": 256}, rotationPolicy={"const": "Always"}),
            usages=several({"enum": ["digital signature", "server auth"]}),
            issuerRef=closed("name", "kind", "group", name=TEXT, kind=TEXT, group=TEXT),
        ),
    ),
}
# It reads a file of megabytes for every object; once is enough.
kubernetes_validate.utils.schema_contents = functools.cache(kubernetes_validate.utils.schema_contents)
_good: set[tuple[str, str]] = set()


def check_object(item: dict[str, Any], kube: str) -> None:
    """jsonschema.ValidationError for what that version of Kubernetes does not know, or refuses; strict."""
    known = (kube, json.dumps(item, sort_keys=True))
    if known in _good:
        return
    if item["kind"] in CUSTOM:
        jsonschema.validate(item, CUSTOM[item["kind"]])
    else:
        kubernetes_validate.validate(item, kube, strict=True)
    _good.add(known)
