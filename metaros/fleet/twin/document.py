"""A twin's document: parsed and checked as a whole, or as a part that a template or a robot's own document is.

A part may hold null (it takes away what stands below it, RFC 7396), and need not say everything of a node.
"""

from __future__ import annotations

import difflib
from collections.abc import Mapping
from dataclasses import dataclass, field
from graphlib import CycleError, TopologicalSorter
from typing import Any, Literal

from metaros.fleet.twin.canonical_json import canonical, digest, join, kind, read
from metaros.fleet.twin.errors import TwinError
from metaros.fleet.twin.fields import Parameters, Word, check_keys, unknown
from metaros.fleet.twin.tables import (
    KINDS_OF_NODE,
    LIFECYCLE_STATES,
    MAX_NODES,
    MAX_ROWS,
    NODE_KEYS,
    SECTIONS,
    TOPIC_KEYS,
)

__all__ = ["NodeSpec", "TopicSpec", "Twin", "parse", "parse_part"]

_PARAMETERS = Parameters()
_STATE = Word(LIFECYCLE_STATES)


@dataclass(frozen=True, slots=True, kw_only=True)
class TopicSpec:
    """One row of `topics`; `given` names the keys that the document holds, the others have the table's defaults."""

    pattern: str
    delivery: Literal["auto", "event", "bulk", "live"]
    rate_hz: float
    forward: bool
    fields: tuple[str, ...]
    metrics_rate_hz: float
    deadband: float
    deadband_max_s: float
    history_hz: float
    latest_only: bool
    given: frozenset[str]


@dataclass(frozen=True, slots=True, kw_only=True)
class NodeSpec:
    """One node: exactly one of `bundle`, `allowed` and `command` is not empty."""

    name: str
    bundle: str
    version: str
    allowed: str
    command: tuple[str, ...]
    args: tuple[str, ...]
    parameters: Mapping[str, Any]
    restart: Literal["always", "on-failure", "never"]
    critical: bool
    nice: int
    after: tuple[str, ...]
    migratable: bool
    run: bool


@dataclass(frozen=True, slots=True, kw_only=True)
class Twin:
    """The whole document. A section that is None is absent: the robot's own settings hold.

    `topics` are in the order in which they are to be tried: the more letters a pattern has beside its wildcards, the
    earlier. `budget_bytes_per_s` of 0 is no limit; `agent_version` of "" leaves the agent's version as it is.
    """

    document: Mapping[str, Any] = field(default_factory=dict)
    topics: tuple[TopicSpec, ...] | None = None
    nodes: Mapping[str, NodeSpec] | None = None
    parameters: Mapping[str, Mapping[str, Any]] | None = None
    lifecycle: Mapping[str, str] | None = None
    budget_bytes_per_s: int | None = None
    agent_version: str = ""

    @property
    def canonical(self) -> bytes:
        """The document's canonical bytes."""
        return canonical(dict(self.document))

    @property
    def sha256(self) -> bytes:
        """Their digest, 32 bytes."""
        return digest(self.canonical)


def parse(source: str | bytes | Mapping[str, Any]) -> Twin:
    """A whole document, checked; TwinError names the path and the limit."""
    document = _loaded(source)
    checked = _sections(document, partial=False)
    nodes = checked.get("nodes")
    if nodes is not None:
        _check_nodes(nodes)
    topics = checked.get("topics")
    return Twin(
        document=document,
        topics=_topics(topics) if topics is not None else None,
        nodes={name: _node(name, row) for name, row in nodes.items()} if nodes is not None else None,
        parameters=checked.get("parameters"),
        lifecycle=checked.get("lifecycle"),
        budget_bytes_per_s=checked.get("budget", {}).get("bytes_per_s"),
        agent_version=checked.get("agent", {}).get("version", ""),
    )


def parse_part(source: str | bytes | Mapping[str, Any]) -> dict[str, Any]:
    """The document of a template, or a robot's own: what it says is checked, what it leaves out is not asked for."""
    document = _loaded(source)
    _sections(document, partial=True)
    return document


def _loaded(source: str | bytes | Mapping[str, Any]) -> dict[str, Any]:
    if isinstance(source, str | bytes):
        return read(source)
    document = dict(source)
    canonical(document)  # its bounds
    return document


def _sections(document: Mapping[str, Any], *, partial: bool) -> dict[str, Any]:
    found: dict[str, Any] = {}
    rows = 0
    for name, value in document.items():
        if name not in SECTIONS:
            raise unknown(name, "", tuple(SECTIONS))
        if partial and value is None:
            continue
        if not isinstance(value, dict):
            raise TwinError(name, f"an object, not {kind(value)}")
        rows += _rows(name, value)
        if rows > MAX_ROWS:
            raise TwinError("", f"the document has more than {MAX_ROWS} rows")
        if name == "nodes" and len(value) > MAX_NODES:
            raise TwinError(name, f"at most {MAX_NODES} nodes, not {len(value)}")
        found[name] = _section(name, value, partial=partial)
    return found


def _rows(name: str, value: Mapping[str, Any]) -> int:
    if name != "parameters":
        return len(value)
    return sum(max(1, len(item)) if isinstance(item, dict) else 1 for item in value.values())


def _section(name: str, value: dict[str, Any], *, partial: bool) -> Any:
    section = SECTIONS[name]
    if section.names is None:
        return check_keys(value, name, section.keys or {}, partial=partial)
    found: dict[str, Any] = {}
    for key, item in value.items():
        path = join(name, key)
        section.names.check(key, path)
        if partial and item is None:
            continue
        if section.keys is not None:
            found[key] = check_keys(_without_nulls(item, partial), path, section.keys, partial=partial)
        elif name == "parameters":
            found[key] = _PARAMETERS.check(_without_nulls(item, partial), path)
        else:
            found[key] = _STATE.check(item, path)
    return found


def _without_nulls(value: Any, partial: bool) -> Any:
    """In a part a parameter may be null, to take it away."""
    if not partial or not isinstance(value, dict):
        return value
    return {
        key: _without_nulls(item, key == "parameters") if key == "parameters" else item
        for key, item in value.items()
        if item is not None
    }


def _check_nodes(nodes: Mapping[str, Mapping[str, Any]]) -> None:
    for name, row in nodes.items():
        path = join("nodes", name)
        given = [word for word in KINDS_OF_NODE if word in row]
        if len(given) != 1:
            found = " and ".join(given) if given else "none"
            raise TwinError(path, f"exactly one of {', '.join(KINDS_OF_NODE)} says what to run; found {found}")
        if ("version" in row) != ("bundle" in row):
            raise TwinError(path, "`bundle` and `version` go together")
        for other in row.get("after", ()):
            if other not in nodes:
                near = difflib.get_close_matches(other, nodes, n=1)
                hint = f"; did you mean {near[0]!r}?" if near else ""
                raise TwinError(join(path, "after"), f"there is no node {other!r} in this document{hint}")
    try:
        TopologicalSorter({name: row.get("after", ()) for name, row in nodes.items()}).prepare()
    except CycleError as error:
        circle = " → ".join(reversed(error.args[1]))
        raise TwinError("nodes", f"after: a circle: {circle}; one of them must start first") from None


def _topics(rows: Mapping[str, Mapping[str, Any]]) -> tuple[TopicSpec, ...]:
    made = []
    for pattern, row in rows.items():
        path = join("topics", pattern)
        values = {key: row.get(key, item.default) for key, item in TOPIC_KEYS.items()}
        if values["deadband"] and not values["fields"]:
            raise TwinError(join(path, "deadband"), "needs `fields`: what is to move")
        if values["latest_only"] and values["class"] == "event":
            raise TwinError(join(path, "latest_only"), "cannot be with class event: every event is kept")
        if values["history_hz"] and (values["class"] in ("event", "bulk") or not values["forward"]):
            raise TwinError(join(path, "history_hz"), "is of live topics that leave the robot: others keep all or none")
        made.append(TopicSpec(pattern=pattern, delivery=values.pop("class"), given=frozenset(row), **values))
    return tuple(sorted(made, key=lambda row: (-len(row.pattern.replace("*", "")), row.pattern)))


def _node(name: str, row: Mapping[str, Any]) -> NodeSpec:
    return NodeSpec(name=name, **{key: row.get(key, item.default) for key, item in NODE_KEYS.items()})
