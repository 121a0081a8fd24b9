"""What docs/howto/upgrade.md promises: a gateway of the version before works on when the next has made its tables."""

from __future__ import annotations

import re

import pytest

from gateway.store.schema import MIGRATIONS, Dialect, migration

PLAIN = Dialect(number="BIGINT PRIMARY KEY", integer="BIGINT", blob="BYTEA")
# It may add. A column that is added may be left out by who does not know it; a running program does not name indexes.
ADDS = re.compile(
    r"CREATE (TABLE|INDEX|UNIQUE INDEX) "
    r"|ALTER TABLE \w+ ADD COLUMN \w+ (BIGINT|TEXT|BYTEA|DOUBLE PRECISION)( NOT NULL DEFAULT \S+)?$"
    r"|DROP INDEX "
    r"|INSERT INTO \w+ VALUES "
)


def statements(text: str) -> list[str]:
    """Each statement on one line."""
    return [" ".join(part.split()) for part in text.split(";") if part.strip()]


@pytest.mark.parametrize("index", range(len(MIGRATIONS)))
def test_a_migration_only_adds(index: int) -> None:
    found = statements(migration(index, PLAIN))
    assert found
    assert [text for text in found if ADDS.match(text) is None] == []


@pytest.mark.parametrize(
    "text",
    ["DROP TABLE robots", "ALTER TABLE robots ADD COLUMN x TEXT NOT NULL", "DELETE FROM robots", "UPDATE x SET y = 1"],
)
def test_what_takes_something_away_would_be_seen(text: str) -> None:
    assert ADDS.match(text) is None
