"""What the dashboard offers of rules is what the gateway has: kinds of happenings, targets, their fields, examples."""

from __future__ import annotations

import re
from pathlib import Path

from gateway.domain.happening import JOURNAL, METRIC, SCHEDULE, TOPIC, WEBHOOK
from gateway.events.kinds import EVENT_KINDS
from gateway.rules.target_kinds import SERVICES, TARGET_KINDS

SOURCE = Path(__file__).resolve().parents[2] / "dashboard" / "src"
KINDS = {f"{JOURNAL}.{row.name}" for row in EVENT_KINDS}


def test_every_kind_that_is_offered_can_happen() -> None:
    offered = re.findall(r'"(metaros\.[\w.]+)"', (SOURCE / "rules" / "types.ts").read_text())
    assert set(offered) == KINDS - {"metaros.journal.lost"} | {WEBHOOK}


def test_every_example_is_of_a_kind_that_there_is() -> None:
    text = (SOURCE / "functions" / "templates.ts").read_text()
    shown = set(re.findall(r'"(metaros\.(?:\w+\.\w+|schedule))", (?:"metaros|robot)', text))
    assert {METRIC, SCHEDULE, TOPIC} < shown
    assert shown <= KINDS | {METRIC, SCHEDULE, TOPIC}


def test_every_kind_of_target_has_its_form() -> None:
    text = (SOURCE / "rules" / "target_fields.ts").read_text()
    table, services = text.split("export const SERVICES")
    kinds = re.findall(r"^  (\w+): \{\s", table, re.MULTILINE)
    assert set(kinds) == {row.name for row in TARGET_KINDS}
    for row in TARGET_KINDS:
        body = table.split(f"\n  {row.name}: {{", 1)[1].split("start:", 1)[0]
        shown = set(re.findall(r'key: "(\w+)"', body)) | ({"robot"} if "ROBOT" in body else set())
        needed = {name for name, field in row.fields.items() if field.needed}
        assert needed <= shown <= set(row.fields), row.name
    for name, fields in SERVICES.items():
        shown = set(re.findall(r'key: "(\w+)"', services.split(f"\n  {name}: [", 1)[1].split("],", 1)[0]))
        assert shown == set(fields), name
