"""The page on patterns says what is so: each row of its tables, each of its examples."""

from __future__ import annotations

import json
import re
from pathlib import Path
from typing import Any

from metaros.automation.rules.field_matcher import OPERATORS
from metaros.automation.rules.index import PatternIndex
from metaros.automation.rules.pattern import compile_pattern
from metaros.automation.rules.schedule import Schedule
from metaros.automation.rules.when import When
from metaros.automation.rules.when_text import KEYS
from tests.support.tables import cases

PAGE = (Path(__file__).resolve().parents[2] / "docs" / "reference" / "patterns.md").read_text()
ENTRIES = re.findall(r"^\| `(.+?)` \| `(\[.*?\])` \| `(\[.*\])` \|$", PAGE, re.MULTILINE)
SCHEDULES = re.findall(r"^\| `((?:cron|rate|at)\(.*\)|\*/.*)` \| ", PAGE, re.MULTILINE)


def blocks(language: str) -> list[str]:
    """The page's blocks of a language."""
    found: list[str] = re.findall(rf"```{language}\n(.*?)```", PAGE, re.DOTALL)
    return found


@cases(("entry", "holds", "not_for"), ENTRIES)
def test_a_row_holds_for_what_it_says(entry: str, holds: str, not_for: str) -> None:
    document: dict[str, Any] = {"field": [json.loads(entry)]}
    pattern, index = compile_pattern(document), PatternIndex()
    index.put("row", pattern)
    for values, expected in ((holds, True), (not_for, False)):
        for value in json.loads(values):
            assert pattern.matches({"field": value}) is expected, value
            assert bool(index.match({"field": value})) is expected, value


def test_the_tables_were_read() -> None:
    assert len(ENTRIES) == 26
    assert len(SCHEDULES) == 12


def test_every_operator_and_key_is_there() -> None:
    assert [name for name in [*OPERATORS, "exists"] if f'`{{"{name}": ' not in PAGE] == []
    assert [name for name in KEYS if f"| `{name}` |" not in PAGE] == []


@cases("expression", SCHEDULES)
def test_a_schedule_acts_some_day(expression: str) -> None:
    assert Schedule.parse(expression, "Europe/Paris").next_after(1_766_000_000_000_000_000) is not None


def test_the_examples_are_read() -> None:
    *patterns, when = [json.loads(text) for text in blocks("json")]
    assert len(patterns) == 2
    for document in patterns:
        compile_pattern(document)
    assert When.parse(when).hysteresis is not None


@cases("text", blocks("python"))
def test_the_snippets_run(text: str) -> None:
    exec(compile(text, "patterns.md", "exec"), {})
