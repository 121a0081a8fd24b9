"""Incompatible publishers and subscriptions of a topic, as `metaros topic info` prints them."""

from __future__ import annotations

from collections.abc import Iterable
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from metaros.cli.shared.output import Output
    from metaros.wire import EndpointToken

__all__ = ["print_problems", "problems"]

_SHOWN = 20


def problems(tokens: Iterable[EndpointToken], topic: str) -> list[dict[str, Any]]:
    """One entry for each pair at odds, by nodes."""
    from metaros.wire.matching import mismatch

    here = sorted(
        (token for token in tokens if token.topic == topic),
        key=lambda token: (token.node.full_name, token.node.zid, token.eid),
    )
    publishers = [token for token in here if token.kind == "MP"]
    subscriptions = [token for token in here if token.kind == "MS"]
    found = []
    for publisher in publishers:
        for subscription in subscriptions:
            between = mismatch(publisher, subscription)
            if between is not None:
                nodes = {"publisher": publisher.node.full_name, "subscriber": subscription.node.full_name}
                found.append({"code": between.code, **nodes, "policies": list(between.policies), "text": between.text})
    return found


def print_problems(out: Output, found: list[dict[str, Any]], *, verbose: bool) -> None:
    """Each of them, or without `verbose` how many there are."""
    if found and not verbose:
        out.note(f"publishers and subscribers that do not fit together: {len(found)} (see -v)")
    elif found:
        out.line(f"\nIncompatible: {len(found)}")
        for problem in found[:_SHOWN]:
            out.line(f"  {problem['code']}: {problem['text']}")
        if len(found) > _SHOWN:
            out.line(f"  and {len(found) - _SHOWN} more")
