"""Templates in the database; inside a transaction of the caller's, which took its turn by `next_change`."""

from __future__ import annotations

from gateway.domain.fleet.selector import Selector
from gateway.domain.fleet.twin import Template, TemplateEntry
from gateway.errors import TooManyError
from gateway.store.engine import Row, StoreEngine, placeholders
from metaros.fleet.twin import canonical, read
from metaros.limits import LIMITS

__all__ = ["MAX_TEMPLATES", "read_template_history", "read_templates", "remove_template", "write_template"]

MAX_TEMPLATES = LIMITS.templates
_COLUMNS = "name, priority, selector, document, revision, author, at_ns, reason"


def read_templates(engine: StoreEngine) -> dict[str, Template]:
    """Every template, by name."""
    rows = engine.fetch(f"SELECT {_COLUMNS} FROM templates ORDER BY name")
    return {row[0]: _template(row) for row in rows}


def write_template(engine: StoreEngine, item: Template) -> None:
    """Add a template, or put it in place of the one of that name; TooManyError when there are as many as may be."""
    known = {row[0] for row in engine.fetch("SELECT name FROM templates")}
    if item.name not in known and len(known) >= MAX_TEMPLATES:
        raise TooManyError(f"there are {MAX_TEMPLATES} templates already")
    engine.execute("DELETE FROM templates WHERE name = ?", item.name)
    engine.execute(f"INSERT INTO templates ({_COLUMNS}) VALUES ({placeholders(8)})", *_row(item))
    _note(engine, TemplateEntry(item))


def remove_template(engine: StoreEngine, item: Template) -> None:
    """Take a template away; its revision, author, time and reason are those of the removal."""
    engine.execute("DELETE FROM templates WHERE name = ?", item.name)
    _note(engine, TemplateEntry(item, removed=True))


def read_template_history(
    engine: StoreEngine, name: str, *, limit: int, revision: int | None = None
) -> list[TemplateEntry]:
    """The changes of a template, also of one that is gone, the newest first; of one revision where that is given."""
    some, values = ("", (name, limit)) if revision is None else (" AND revision = ?", (name, revision, limit))
    rows = engine.fetch(
        f"SELECT {_COLUMNS}, removed FROM template_history WHERE name = ?{some} ORDER BY revision DESC LIMIT ?",
        *values,
    )
    return [TemplateEntry(_template(row), removed=bool(row[8])) for row in rows]


def _note(engine: StoreEngine, entry: TemplateEntry) -> None:
    engine.execute(
        f"INSERT INTO template_history ({_COLUMNS}, removed) VALUES ({placeholders(9)})",
        *_row(entry.template),
        int(entry.removed),
    )
    engine.execute(
        "DELETE FROM template_history WHERE revision <="
        " (SELECT revision FROM template_history ORDER BY revision DESC LIMIT 1 OFFSET ?)",
        LIMITS.template_history,
    )


def _template(row: Row) -> Template:
    return Template(
        name=row[0],
        priority=row[1],
        selector=Selector.parse(row[2]),
        document=read(bytes(row[3])),
        revision=row[4],
        author=row[5],
        at_ns=row[6],
        reason=row[7],
    )


def _row(item: Template) -> Row:
    document = canonical(dict(item.document))
    return item.name, item.priority, item.selector.text, document, item.revision, item.author, item.at_ns, item.reason
