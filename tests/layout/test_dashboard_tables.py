"""What the dashboard offers of rules, and its words for the audit log, fit what the gateway has."""

from __future__ import annotations

import re
from pathlib import Path

from gateway.api import ROUTERS
from gateway.api.authorization import RPC_PERMISSIONS, SAFE_METHODS, routes_of
from gateway.automation.events.kinds import EVENT_KINDS
from gateway.automation.rules.target_kinds import SERVICES, TARGET_KINDS
from gateway.domain.automation.gateway_event import JOURNAL, METRIC, SCHEDULE, TOPIC, WEBHOOK
from gateway.identity.permissions import PERMISSIONS, permission

SOURCE = Path(__file__).resolve().parents[2] / "dashboard" / "src"
GATEWAY = Path(__file__).resolve().parents[2] / "gateway"
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


def test_every_operation_that_the_audit_log_tells_of_has_words() -> None:
    """Reading has a row where it was refused, and says it by its path."""
    text = (SOURCE / "admin" / "audit_acts.ts").read_text()
    worded = set(re.findall(r'^  "([A-Z]+ /[^"]+)": "', text, re.MULTILINE))
    served = {
        f"{method} {path.removeprefix('/api/v1').replace(':path', '')}"
        for method, path, _ in routes_of(ROUTERS)
        if method not in SAFE_METHODS
    }
    called = {f"GRPC {path}" for path, name in RPC_PERMISSIONS.items() if permission(name).mutates}
    by_get = {"GET /auth/oidc/start", "GET /auth/oidc/callback"}  # a GET that signs in
    assert (served | called | by_get) ^ worded == set()


def test_the_audit_log_can_be_narrowed_to_every_permission_that_changes_something() -> None:
    text = (SOURCE / "admin" / "audit_acts.ts").read_text()
    table, about = text.split("export const STORE_ACTS")[1].split("export const ABOUT")
    offered = set(re.findall(r'\["([a-z_.]+)", "', about))
    assert {row.name for row in PERMISSIONS if row.mutates} <= offered <= {row.name for row in PERMISSIONS}
    in_the_store = {
        action
        for path in [*(GATEWAY / "cli").rglob("*.py"), *(GATEWAY / "backup").rglob("*.py")]
        for action in re.findall(r'(?:\.change\(\s*|\bACTION = |\baction=)"([a-z_]+\.[a-z_]+)"', path.read_text())
    }
    assert in_the_store == set(re.findall(r'"([a-z_.]+)": "', table))
