"""Liveliness tokens: how nodes and endpoints announce themselves to everybody's graph."""

from __future__ import annotations

import re
from dataclasses import dataclass
from functools import cached_property
from typing import Literal

from metaros.errors import NameError_, TokenError
from metaros.limits import LIMITS
from metaros.wire.gid import gid_of
from metaros.wire.keys import parse_domain
from metaros.wire.names import check_hash, dds_name, mangle, ros_name, unmangle
from metaros.wire.qos import QoSProfile

__all__ = ["ENDPOINT_KINDS", "EndpointKind", "EndpointToken", "NodeToken", "parse_token", "tokens_of_domain"]

PREFIX = "@ros2_lv"
EndpointKind = Literal["MP", "MS", "SS", "SC"]
ENDPOINT_KINDS: dict[EndpointKind, str] = {
    "MP": "publisher",
    "MS": "subscription",
    "SS": "service server",
    "SC": "service client",
}
_TOKEN_CHARS = 4 * LIMITS.key_chars
_ZID = re.compile(r"[0-9a-f]{1,32}", re.ASCII)
_COUNT = re.compile(r"[0-9]{1,19}", re.ASCII)
_NAME = re.compile(r"[A-Za-z_][A-Za-z0-9_]*", re.ASCII)
_PATH = re.compile(r"%|(?:%[A-Za-z_][A-Za-z0-9_]*)+", re.ASCII)
_QOS = re.compile(r"[0-9:,]+", re.ASCII)
_BACKENDS = re.compile(r"backends:[^/#?*$\s]*")


def tokens_of_domain(domain: int) -> str:
    """The key expression of every token in a domain; `@` parts are never matched by `**`, so it is spelt out."""
    return f"{PREFIX}/{domain}/**"


@dataclass(frozen=True)
class NodeToken:
    """One node. `namespace` is `/` or `/a/b`; `nid` counts the session's entities from 0."""

    domain: int
    zid: str
    nid: int
    name: str
    namespace: str = "/"
    enclave: str = "/"

    def __str__(self) -> str:
        """The token's key."""
        where = f"{mangle(self.enclave)}/{mangle(self.namespace)}/{self.name}"
        return f"{PREFIX}/{self.domain}/{self.zid}/{self.nid}/{self.nid}/NN/{where}"

    @property
    def full_name(self) -> str:
        """`/ns/name`."""
        return f"{self.namespace.rstrip('/')}/{self.name}"


@dataclass(frozen=True)
class EndpointToken:
    """One publisher, subscription, service server or client of a node."""

    node: NodeToken
    eid: int
    kind: EndpointKind
    topic: str
    type_name: str
    type_hash: str
    qos_text: str
    backends: str | None = None

    def __str__(self) -> str:
        """The token's key."""
        node = self.node
        where = f"{mangle(node.enclave)}/{mangle(node.namespace)}/{node.name}"
        what = f"{mangle(self.topic)}/{dds_name(self.type_name)}/{self.type_hash}/{self.qos_text}"
        tail = "" if self.backends is None else f"/{self.backends}"
        return f"{PREFIX}/{node.domain}/{node.zid}/{node.nid}/{self.eid}/{self.kind}/{where}/{what}{tail}"

    @cached_property
    def gid(self) -> bytes:
        """What stands in the attachments of this endpoint's samples."""
        return gid_of(str(self))

    @cached_property
    def qos(self) -> QoSProfile:
        """The profile behind `qos_text`."""
        return QoSProfile.decode(self.qos_text)


def parse_token(key: str) -> NodeToken | EndpointToken:
    """Read a token; TokenError for anything that no ROS 2 node would announce."""
    if len(key) > _TOKEN_CHARS:
        raise TokenError(f"token of {len(key)} characters is longer than the limit of {_TOKEN_CHARS}")
    parts = key.split("/")
    if len(parts) not in (9, 13, 14) or parts[0] != PREFIX:
        raise TokenError(f"token of {len(parts)} parts: 9 for a node, 13 or 14 for an endpoint, after {PREFIX}")
    kind, eid = parts[5], _count(parts[4])
    if (kind == "NN") != (len(parts) == 9):
        raise TokenError(f"token kind {kind!r} with {len(parts)} parts")
    node = _node(parts)
    if kind == "NN":
        if eid != node.nid:
            raise TokenError("a node's token repeats its id, this one does not")
        return node
    if kind not in ENDPOINT_KINDS:
        raise TokenError(f"unknown token kind {kind!r}")
    return _endpoint(node, eid, kind, parts[9:])


def _node(parts: list[str]) -> NodeToken:
    zid, enclave, namespace, name = parts[2], parts[6], parts[7], parts[8]
    if _ZID.fullmatch(zid) is None:
        raise TokenError(f"{zid!r} is no Zenoh id")
    if _PATH.fullmatch(enclave) is None or _PATH.fullmatch(namespace) is None or _NAME.fullmatch(name) is None:
        raise TokenError("enclave, namespace or node name in the token breaks the grammar of ROS names")
    try:
        domain = parse_domain(parts[1])
    except NameError_ as error:
        raise TokenError(str(error)) from None
    return NodeToken(domain, zid, _count(parts[3]), name, unmangle(namespace), unmangle(enclave))


def _endpoint(node: NodeToken, eid: int, kind: EndpointKind, parts: list[str]) -> EndpointToken:
    topic, dds, type_hash, qos_text = parts[:4]
    backends = parts[4] if len(parts) == 5 else None
    if topic == "%" or _PATH.fullmatch(topic) is None:
        raise TokenError("topic name in the token breaks the grammar of ROS names")
    if backends is not None and _BACKENDS.fullmatch(backends) is None:
        raise TokenError(f"{backends!r} is no list of backends")
    try:
        type_name = ros_name(dds)
        check_hash(type_hash)
    except NameError_ as error:
        raise TokenError(str(error)) from None
    token = EndpointToken(node, eid, kind, unmangle(topic), type_name, type_hash, qos_text, backends)
    if _QOS.fullmatch(qos_text) is None or token.qos is None:
        raise TokenError(f"{qos_text!r} is no QoS string")
    return token


def _count(text: str) -> int:
    if _COUNT.fullmatch(text) is None:
        raise TokenError(f"{text!r} is no entity number")
    return int(text)
