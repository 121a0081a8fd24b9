"""Publishers, subscribers, servers and clients in words: counts, and with `-v` every one of them."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from metaros.cli.shared.output import Output
    from metaros.wire import EndpointInfo, QoSProfile

__all__ = ["endpoint_facts", "print_endpoints", "qos_words"]

KINDS = {"MP": "publisher", "MS": "subscriber", "SS": "server", "SC": "client"}
NO_LIMIT_NS = (1 << 63) - 1


def endpoint_facts(item: EndpointInfo) -> dict[str, Any]:
    """One endpoint for JSON."""
    return {
        "kind": KINDS[item.kind],
        "node": item.node,
        "namespace": item.namespace,
        "type": item.type_name,
        "type_hash": item.type_hash,
        "gid": item.gid.hex(),
        "qos": _qos(item.qos),
    }


def print_endpoints(
    out: Output, ends: Sequence[EndpointInfo], kinds: Sequence[tuple[str, str]], *, verbose: bool
) -> None:
    """The type, then for each kind how many there are; with `verbose` each of them."""
    types = sorted({item.type_name for item in ends})
    out.line(f"Type: {' or '.join(types)}")
    if len({item.type_hash for item in ends}) > len(types):
        out.note("the type's hash differs between nodes: they were built from different definitions (see -v)")
    for kind, title in kinds:
        own = [item for item in ends if item.kind == kind]
        out.line(f"{'' if not verbose else chr(10)}{title}: {len(own)}")
        for item in own if verbose else ():
            _print_endpoint(out, item)


def _qos(qos: QoSProfile) -> dict[str, Any]:
    durations = {
        name: getattr(qos, name) for name in ("deadline_ns", "lifespan_ns") if 0 < getattr(qos, name) < NO_LIMIT_NS
    }
    return {
        "reliability": qos.reliability.name,
        "history": qos.history.name,
        "depth": qos.depth,
        "durability": qos.durability.name,
        **durations,
    }


def qos_words(qos: QoSProfile) -> str:
    """`RELIABLE, VOLATILE, KEEP_LAST (10)`, with what else is not the default."""
    depth = f" ({qos.depth})" if qos.history.name == "KEEP_LAST" else ""
    more = "".join(
        f", {name} {value / 1e9:g} s"
        for name, value in (("deadline", qos.deadline_ns), ("lifespan", qos.lifespan_ns))
        if 0 < value < NO_LIMIT_NS
    )
    return f"{qos.reliability.name}, {qos.durability.name}, {qos.history.name}{depth}{more}"


def _print_endpoint(out: Output, item: EndpointInfo) -> None:
    rows = (
        ("Node", item.node_full_name),
        ("Type", item.type_name),
        ("Type hash", item.type_hash),
        ("GID", item.gid.hex()),
        ("QoS", qos_words(item.qos)),
    )
    out.line()
    for label, value in rows:
        out.line(f"  {out.style(label.ljust(9), '2')}  {value}")
