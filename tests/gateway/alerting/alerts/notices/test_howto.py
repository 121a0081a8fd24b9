"""What docs/howto/notify.md shows is so: the file, the notice, the check of a signature."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

import orjson

from gateway.alerting.alerts.notices.document import Notice, cloud_event
from gateway.alerting.alerts.notices.routes import SMTP_KEYS, WEBHOOK_KEYS, load_routes
from gateway.domain.alert import Alert
from gateway.outbound.webhook import signature
from tests.gateway.alerting.alerts.findings import NOW, S

PAGE = (Path(__file__).resolve().parents[5] / "docs" / "howto" / "notify.md").read_text()


def block(language: str) -> str:
    """The page's first block of a language."""
    found = re.search(rf"```{language}\n(.*?)```", PAGE, re.DOTALL)
    assert found is not None
    return found[1]


def alert() -> Alert:
    """An open one, with little to say."""
    at_ns = {"opened_ns": NOW, "first_ns": NOW, "changed_ns": NOW, "seen_ns": NOW}
    return Alert(id="A", robot="r1", cause="heat", state="open", severity="error", title="Too hot", **at_ns)


def test_the_file_is_one(tmp_path: Path) -> None:
    for name in ("ops.secret", "night.password"):
        (tmp_path / name).write_text("swordfish")
        (tmp_path / name).chmod(0o600)
    (tmp_path / "notify.toml").write_text(block("toml"))
    hook, mail = load_routes(tmp_path / "notify.toml")
    assert (hook.name, hook.link) == ("ops", "https://fleet.example.org")
    assert (mail.name, mail.severity, mail.robots) == ("night", "error", ("agv-*",))


def test_every_key_is_on_the_page() -> None:
    assert [key for key in (*WEBHOOK_KEYS, *SMTP_KEYS) if f"`{key}`" not in PAGE] == []


def test_a_notice_has_the_fields_that_are_shown() -> None:
    shown = orjson.loads(block("json"))
    made = cloud_event(Notice(alert(), "opened"), now_ns=NOW, link="https://fleet.example.org")
    assert shown.keys() == made.keys()
    assert shown["data"].keys() == made["data"].keys()


def test_the_signature_is_checked_as_the_page_says() -> None:
    names: dict[str, Any] = {}
    exec(block("python"), names)
    body = b'{"specversion":"1.0"}'
    made = signature(b"swordfish", body, message="A.opened", at_s=NOW // S)
    headers = {"webhook-id": "A.opened", "webhook-timestamp": str(NOW // S), "webhook-signature": made}
    assert names["is_ours"](b"swordfish", headers, body, now_s=NOW / S)
    assert not names["is_ours"](b"swordfish", headers, body + b" ", now_s=NOW / S)
    assert not names["is_ours"](b"swordfish", headers, body, now_s=NOW / S + 301)
    assert not names["is_ours"](b"other", headers, body, now_s=NOW / S)
