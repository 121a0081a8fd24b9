"""Templates in the database; inside a transaction of the caller's, which took its turn by `next_change`."""

from __future__ import annotations

from gateway.domain.selector import Selector
from gateway.domain.twin import Template
from gateway.errors import TooManyError
from gateway.store.engine import StoreEngine
from metaros.limits import LIMITS
from metaros.twin import canonical, read

__all__ = ["MAX_TEMPLATES", "read_templates", "remove_template", "write_template"]

MAX_TEMPLATES = LIMITS.templates


def read_templates(engine: StoreEngine) -> dict[str, Template]:
    """Every template, by name."""
    rows = engine.fetch(
        "SELECT name, priority, selector, document, revision, author, at_ns, reason FROM templates ORDER BY name"
    )
    return {
        row[0]: Template(
            name=row[0],
            priority=row[1],
            selector=Selector.parse(row[2]),
            document=read(bytes(row[3])),
            revision=row[4],
            author=row[5],
            at_ns=row[6],
            reason=row[7],
        )
        for row in rows
    }


def write_template(engine: StoreEngine, item: Template) -> None:
    """Add a template, or put it in place of the one of that name; TooManyError when there are as many as may be."""
    known = {row[0] for row in engine.fetch("SELECT name FROM templates")}
    if item.name not in known and len(known) >= MAX_TEMPLATES:
        raise TooManyError(f"there are {MAX_TEMPLATES} templates already")
    engine.execute("DELETE FROM templates WHERE name = ?", item.name)
    engine.execute(
        "INSERT INTO templates VALUES (?, ?, ?, ?, ?, ?, ?, ?)",
        item.name,
        item.priority,
        item.selector.text,
        canonical(dict(item.document)),
        item.revision,
        item.author,
        item.at_ns,
        item.reason,
    )


def remove_template(engine: StoreEngine, name: str) -> bool:
    """Take a template away; False when there is none of that name."""
    return bool(engine.execute("DELETE FROM templates WHERE name = ?", name))
