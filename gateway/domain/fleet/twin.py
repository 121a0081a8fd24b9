"""Desired and reported state of robots: what is stored of them, and how templates and own documents become one."""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

from gateway.domain.fleet.selector import Selector
from metaros.fleet.twin import KINDS_OF_NODE, merge, merge_all

__all__ = [
    "CODE_KEYS",
    "CONFIRM_S",
    "Desired",
    "Reported",
    "Template",
    "TemplateEntry",
    "TwinEntry",
    "changes_code",
    "effective",
    "is_template_name",
    "made_of",
]

CODE_KEYS = ("bundle", "version", "allowed", "command", "args")  # of a node: what runs there, an admin's to say
CONFIRM_S = 60.0  # a change that nobody gave another window
_TEMPLATE_NAME = re.compile(r"[A-Za-z0-9][A-Za-z0-9_.-]{0,63}")


@dataclass(frozen=True, slots=True, kw_only=True)
class Template:
    """A part of a document for all robots that its selector names; a higher priority is laid over a lower one."""

    name: str
    selector: Selector
    document: Mapping[str, Any]
    priority: int = 0
    revision: int = 1
    author: str = ""
    at_ns: int = 0
    reason: str = ""

    @property
    def mark(self) -> str:
        """The template as it is now, in one word."""
        return f"{self.name}@{self.revision}"


@dataclass(frozen=True, slots=True)
class TemplateEntry:
    """One change of a template: what it was from then on, or, `removed`, until then. Author, time, reason: of it."""

    template: Template
    removed: bool = False

    @property
    def document(self) -> Mapping[str, Any]:
        """What it gave robots from then on."""
        return {} if self.removed else self.template.document


@dataclass(frozen=True, slots=True, kw_only=True)
class Desired:
    """What a robot is to be. `revision` 0: nobody ever said; `edition` counts every change, also of labels."""

    robot: str
    revision: int = 0
    edition: int = 0
    change: int = 0  # of the store, in the order in which changes are committed
    own: bytes = b"{}"  # canonical JSON, a part
    document: bytes = b"{}"  # canonical JSON, whole: templates and own together
    sha256: bytes = b""
    labels: Mapping[str, str] = field(default_factory=dict)  # that people gave it
    templates: tuple[str, ...] = ()  # the marks of those that are in the document
    problem: str = ""  # why the document is not what templates and own would give now
    author: str = ""
    at_ns: int = 0
    reason: str = ""
    confirm_within_s: float = CONFIRM_S


@dataclass(frozen=True, slots=True, kw_only=True)
class TwinEntry:
    """One change of a robot's desired state, as the history keeps it."""

    edition: int
    revision: int
    at_ns: int
    author: str
    reason: str
    own: bytes
    document: bytes


@dataclass(frozen=True, slots=True, kw_only=True)
class Reported:
    """The last TwinReport of a robot, and when it came."""

    robot: str
    at_ns: int
    revision: int
    applied: int
    state: str
    code: str = ""
    message: str = ""
    sha256: bytes = b""
    reported: bytes = b"{}"  # JSON, as the robot sent it


def is_template_name(text: str) -> bool:
    """True for 1 to 64 letters, digits, `_`, `.` and `-` that start with a letter or digit."""
    return _TEMPLATE_NAME.fullmatch(text) is not None


def made_of(templates: Iterable[Template], robot: str, labels: Mapping[str, str]) -> list[Template]:
    """The templates that name a robot, in the order in which they are laid over each other."""
    named = [item for item in templates if item.selector.matches(robot, labels)]
    return sorted(named, key=lambda item: (item.priority, item.name))


def effective(
    templates: Sequence[Template], own: Mapping[str, Any], *, before: Mapping[str, Any] | None = None
) -> dict[str, Any]:
    """Templates in their order and the robot's own document on top; to be checked by `metaros.fleet.twin.parse`.

    What `own` says of a template's node (that it is stopped, its version) waits while no template brings that node: it
    breaks nothing. Where `before` is given, only what that own document said already: a change has to make sense now.
    """
    below = merge_all(item.document for item in templates)
    whole: dict[str, Any] = merge(below, own)
    rows, known = own.get("nodes") or {}, own if before is None else before
    said = known.get("nodes") or {}
    for name, row in rows.items():
        bare = isinstance(row, dict) and not any(row.get(key) for key in KINDS_OF_NODE)
        if bare and name not in (below.get("nodes") or {}) and said.get(name) == row:
            del whole["nodes"][name]
            if not whole["nodes"]:
                del whole["nodes"]
    return whole


def changes_code(old: Mapping[str, Any], new: Mapping[str, Any]) -> str:
    """The first path by which a robot would run other code than before; "" for none. Both are effective documents."""
    before, after = old.get("nodes") or {}, new.get("nodes") or {}
    for name, row in after.items():
        was = before.get(name, {})
        for key in CODE_KEYS:
            if row.get(key) != was.get(key) and (row.get(key) or was.get(key)):
                return f"nodes.{name}.{key}"
    version = (new.get("agent") or {}).get("version")
    return "agent.version" if version and version != (old.get("agent") or {}).get("version") else ""
