"""Names in the graph: which are hidden, and the error for one that is not there."""

from __future__ import annotations

from collections.abc import Collection, Iterable

from metaros.errors import UnavailableError

__all__ = ["is_hidden", "known_type", "no_such"]


def is_hidden(name: str) -> bool:
    """ROS hides a topic or service with a part that begins with `_`: the five of each action, for one."""
    return "/_" in name


def no_such(what: str, name: str, known: Iterable[str]) -> UnavailableError:
    """The error to raise: there is no such topic, service, action or node; it says which one may be meant."""
    from metaros.cli.shared.connection import closest

    hint = closest(name, known) or f"`metaros {what} list` shows those there are"
    says = {"service": "nobody serves", "action": "nobody serves the action"}.get(what, f"no {what}")
    return UnavailableError(f"{says} {name!r}{' in the graph' if says.startswith('no ') else ''}\n{hint}")


def known_type(name: str, kind: str, in_use: Collection[str]) -> str:
    """The full name of a type that is in use in the graph or in the catalogue; UnknownTypeError otherwise."""
    from metaros.cli.shared.types import expand, full_type

    full = expand(name, kind)
    return full if full in in_use else full_type(name, kind)
