"""The reference page says everything that the agent can be told."""

from __future__ import annotations

from dataclasses import fields
from pathlib import Path

import pytest

from edge_agent.config.black_box import BlackBoxSettings
from edge_agent.config.settings import RULE_KEYS, OutboxSettings, Settings
from edge_agent.config.topic_table import DEFAULT_TOPICS, TopicRule

PAGE = (Path(__file__).resolve().parents[2] / "docs" / "reference" / "agent.md").read_text()


@pytest.mark.parametrize("rule", DEFAULT_TOPICS, ids=lambda rule: rule.match)
def test_the_default_table_is_documented(rule: TopicRule) -> None:
    listed = ", ".join(f"`{path}`" for path in rule.fields)
    assert f"| `{rule.match}` | {rule.delivery} | {rule.max_rate_hz:g} | {rule.history_hz:g} | {listed}" in PAGE


def test_every_setting_and_key_is_documented() -> None:
    tables = ("topics", "status_file", "labels", "outbox", "black_box")
    names = [item.name for item in fields(Settings) if item.name not in tables]
    names += [*(item.name for item in fields(OutboxSettings)), *RULE_KEYS, "default_topics", "[labels]"]
    names += [f"[black_box] {item.name}" for item in fields(BlackBoxSettings)]
    assert [name for name in names if f"`{name}`" not in PAGE and f"{name}`" not in PAGE] == []
