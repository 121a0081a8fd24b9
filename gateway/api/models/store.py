"""The documents of /api/v1/store as models, for OpenAPI and the tests."""

from __future__ import annotations

from typing import Literal

from pydantic import Field

from gateway.api.models.base import Exact

__all__ = ["RetentionPlan", "StoreAccount"]

ClassName = Literal["metric", "bulk", "event", "recording"]


class ClassAccount(Exact):
    """One class, and its own bounds."""

    class_: ClassName = Field(alias="class")
    bytes: int
    oldest: str | None
    keep_days: float | None
    keep_bytes: int | None


class RobotAccount(Exact):
    """What one robot takes."""

    robot: str
    bytes: int


class TableAccount(Exact):
    """One table of the database."""

    table: str
    rows: int
    bytes: int


class ObjectsAccount(Exact):
    """The object store by the states of the ledger; `bytes` of the stored ones."""

    where: str
    stored: int
    bytes: int
    uploading: int
    doomed: int


class DamageAccount(Exact):
    """One finding of the last check."""

    object: str | None
    robot: str | None
    topic: str | None
    start: str | None
    end: str | None
    what: str


class StoreAccount(Exact):
    """What is stored, how fast it grows, and what is damaged."""

    total_bytes: int
    keep_bytes: int
    disk_free_bytes: int | None
    growth_bytes_per_day: int | None
    days_until_bound: float | None
    days_until_full: float | None
    classes: list[ClassAccount]
    robots: list[RobotAccount]
    tables: list[TableAccount]
    objects: ObjectsAccount
    damaged: list[DamageAccount]
    checked: str | None


class PlanItem(Exact):
    """What goes of a class for one reason."""

    class_: ClassName = Field(alias="class")
    why: Literal["age", "class_size", "store_size"]
    count: int
    bytes: int
    oldest: str
    newest: str


class RetentionPlan(Exact):
    """What the next purge would delete."""

    items: list[PlanItem]
    bytes: int
    gaps: int
