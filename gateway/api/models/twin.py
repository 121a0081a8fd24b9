"""Bodies and answers about twins and templates, for OpenAPI and for checking."""

from __future__ import annotations

from typing import Any, Literal

from pydantic import Field

from gateway.api.models.base import Exact, Model

__all__ = [
    "LabelsChange",
    "Revert",
    "Template",
    "TemplateChange",
    "TemplateHistory",
    "TemplateList",
    "TemplateRequest",
    "Twin",
    "TwinChange",
    "TwinHistory",
    "TwinList",
    "TwinsChange",
]

Document = dict[str, Any]


class Change(Model):
    """One difference; `path` is a JSON pointer. `old` or `new` is left out where the key is not there."""

    path: str
    verb: Literal["add", "remove", "change"]
    old: Any = None
    new: Any = None


class ReportedTwin(Model):
    """What the robot said last. `applied` is the revision that it lives by, 0 its own settings."""

    at: str
    revision: int
    applied: int
    state: Literal["applied", "applying", "confirming", "reverted", "refused"]
    code: str
    message: str
    values: Document


class TwinBrief(Model):
    """One robot's twin in one line. `in_step`: it lives by what is desired."""

    robot: str
    revision: int
    edition: int
    in_step: bool
    state: str
    applied: int
    code: str
    message: str
    templates: list[str]
    labels: dict[str, str]
    problem: str


class Twin(Model):
    """One robot's twin. `own` on top of the templates makes `desired`; `behind`: from what it lives by to that."""

    robot: str
    revision: int
    edition: int
    in_step: bool
    own: Document
    desired: Document
    templates: list[str]
    labels: dict[str, str]
    own_labels: dict[str, str]
    problem: str
    author: str
    at: str | None
    reason: str
    confirm_within_s: float
    reported: ReportedTwin | None
    behind: list[Change]


class TwinList(Model):
    """Twins by robot."""

    twins: list[TwinBrief]
    next: str | None


class TwinChange(Model):
    """What an edit did, or would do: to the robot's own document and to the whole that it gets."""

    robot: str
    dry_run: bool
    revision: int
    edition: int
    changed: bool
    changes: list[Change]
    own_changes: list[Change]
    own_labels: dict[str, str]
    more: int = Field(description="changes beyond those that are listed")


class TwinsChange(Model):
    """The same of many robots."""

    dry_run: bool
    robots: int
    changed: int
    results: list[TwinChange]


class TwinEntry(Model):
    """One change of a robot's desired state; `changes` are those against the entry before."""

    revision: int
    edition: int
    at: str
    author: str
    reason: str
    changes: list[Change]
    own: Document
    desired: Document


class TwinHistory(Model):
    """The newest first; `more` older ones had no room in this answer."""

    entries: list[TwinEntry]
    more: int


class Revert(Exact):
    """Which revision to go back to: of a robot's own document, where 0 is an empty one, or of a template."""

    revision: int = Field(ge=0, le=1 << 53)


class LabelsChange(Exact):
    """Labels to give; null takes one away."""

    labels: dict[str, str | None] = Field(max_length=64)


class TemplateRequest(Exact):
    """A template: a part of a twin's document for all robots that the selector names."""

    selector: str = Field(max_length=4096)
    document: Document
    priority: int = Field(default=0, ge=-1000, le=1000)


class Template(Model):
    """A template as it is stored."""

    name: str
    selector: str
    priority: int
    revision: int
    author: str
    at: str
    reason: str
    document: Document


class TemplateEntry(Template):
    """One change of a template; `changes` of its document are those against the entry before."""

    removed: bool
    changes: list[Change]


class TemplateHistory(Model):
    """The newest first; `more` older ones had no room in this answer."""

    entries: list[TemplateEntry]
    more: int


class TemplateList(Model):
    """In the order in which they are laid over each other."""

    templates: list[Template]
    next: str | None


class TemplateChange(Model):
    """What a change of a template did, or would do, to the robots that it reaches."""

    dry_run: bool
    template: Template
    robots: int
    changed: int
    results: list[TwinChange]
