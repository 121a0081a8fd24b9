"""Every key of a twin's document in tables: what it means, its kind and limit, and what holds where it is absent."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from types import MappingProxyType
from typing import Final

from metaros.fleet.twin.fields import Flag, Key, Number, Parameters, Text, Texts, Whole, Word
from metaros.limits import LIMITS

__all__ = [
    "AGENT_KEYS",
    "BUDGET_KEYS",
    "KINDS_OF_NODE",
    "LIFECYCLE_STATES",
    "MAX_NODES",
    "MAX_ROWS",
    "NODE_KEYS",
    "SECTIONS",
    "TOPIC_KEYS",
    "Section",
]

MAX_NODES: Final = 256
MAX_ROWS: Final = 4096  # of all sections together: topics, nodes, parameters, lifecycle states
KINDS_OF_NODE: Final = ("bundle", "allowed", "command")
LIFECYCLE_STATES: Final = ("inactive", "active", "finalized")

_NAME: Final = r"[A-Za-z_][A-Za-z0-9_]*"
_VERSION: Final = Text(64, r"[0-9]{1,9}(?:\.[0-9]{1,9}){1,3}", "two to four numbers with dots, such as 1.2.0")
_BUNDLE: Final = Text(63, r"[a-z0-9][a-z0-9-]*", "small letters, digits and -")
_TARGET: Final = Text(64, r"[A-Za-z0-9][A-Za-z0-9_.-]*", "letters, digits, _ . and -")
_ARGUMENT: Final = Text(4096, least=0)
_RATE: Final = Number(0, 1e6)

TOPIC_KEYS: Final[Mapping[str, Key]] = MappingProxyType(
    {
        "class": Key(Word(("auto", "event", "bulk", "live")), "auto", "how the link treats its samples"),
        "rate_hz": Key(_RATE, 0.0, "at most so many samples a second; 0 = all"),
        "forward": Key(Flag(), True, "whether its samples leave the robot"),
        "fields": Key(Texts(64, Text(256)), (), "the numeric fields that are series"),
        "metrics_rate_hz": Key(_RATE, 2.0, "at most so many rows a second of each series"),
        "deadband": Key(Number(0, 1e300), 0.0, "a sample goes only when a field moved by more; needs `fields`"),
        "deadband_max_s": Key(_RATE, 60.0, "and at the latest after so many seconds; 0 = never without a move"),
        "history_hz": Key(_RATE, 0.0, "of a live topic: so many samples a second are stored, watched or not"),
        "latest_only": Key(Flag(), False, "of bulk: while it is behind, only the newest sample waits"),
    }
)
NODE_KEYS: Final[Mapping[str, Key]] = MappingProxyType(
    {
        "bundle": Key(_BUNDLE, "", "the signed bundle that it runs; needs `version`"),
        "version": Key(_VERSION, "", "of the bundle"),
        "allowed": Key(_TARGET, "", "the entry of the robot's own allow-list that it runs"),
        "command": Key(Texts(64, Text(4096), 1), (), "program and arguments, where the robot allows free commands"),
        "args": Key(Texts(256, _ARGUMENT), (), "further arguments"),
        "parameters": Key(Parameters(), {}, "ROS parameters that it starts with"),
        "restart": Key(Word(("always", "on-failure", "never")), "always", "after which exits it is started again"),
        "critical": Key(Flag(), False, "never given up; each further death asks for a safe stop"),
        "nice": Key(Whole(-20, 19), 0, "priority of its process: the lower, the more of a busy processor"),
        "after": Key(Texts(64, Text(64, _NAME, "the name of a node")), (), "nodes that are started before it"),
        "migratable": Key(Flag(), False, "runs elsewhere in the robot's group when this robot is lost; under a lease"),
        "run": Key(Flag(), True, "false: it stays in the table and is stopped"),
    }
)
BUDGET_KEYS: Final[Mapping[str, Key]] = MappingProxyType(
    {
        "bytes_per_s": Key(
            Whole(LIMITS.uplink_least_bytes_per_s, 1 << 40, zero=True), 0, "what the link may send; 0 = no limit"
        )
    }
)
AGENT_KEYS: Final[Mapping[str, Key]] = MappingProxyType({"version": Key(_VERSION, "", "of the agent itself")})


@dataclass(frozen=True, slots=True)
class Section:
    """One top-level key. `names`: what its keys are, None where it is one row of `keys`."""

    meaning: str
    names: Text | None
    keys: Mapping[str, Key] | None  # of a row; None where a row is no object of keys


_PATTERN: Final = Text(
    256, r"[A-Za-z0-9_/*~.\[\]\-]+", "a pattern is letters, digits, _ - . / and the wildcards * and **"
)
_NODE_PATH: Final = Text(256, rf"/?{_NAME}(?:/{_NAME})*", "a node's name, full (/ns/name) or relative to the robot's")
SECTIONS: Final[Mapping[str, Section]] = MappingProxyType(
    {
        "topics": Section("topics that leave the robot, by pattern", _PATTERN, TOPIC_KEYS),
        "nodes": Section("nodes that the robot runs", Text(64, _NAME, "letters, digits and _"), NODE_KEYS),
        "parameters": Section("parameters of running nodes, by node", _NODE_PATH, None),
        "lifecycle": Section("states of managed nodes: inactive, active or finalized", _NODE_PATH, None),
        "budget": Section("what the robot may send", None, BUDGET_KEYS),
        "agent": Section("the robot's agent", None, AGENT_KEYS),
    }
)
