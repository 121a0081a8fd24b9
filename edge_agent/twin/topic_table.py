"""The topic table with the twin's rows laid over the robot's own.

A row's keys that the twin does not give stay as the robot's own row of that topic has them. What the robot seals stays
sealed, and the fields that it lets out of a sealed topic stay those that it names: the gateway is not to be trusted
with what is sealed from it, so it must not be able to say otherwise.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any, Final

from edge_agent.config.topic_table import TopicRule, TopicTable
from metaros.fleet.twin import TopicSpec
from metaros.idl.globs import Glob

__all__ = ["TwinTopicTable"]

KEYS: Final = ("forward", "fields", "metrics_rate_hz", "deadband", "deadband_max_s", "history_hz", "latest_only")


class TwinTopicTable(TopicTable):
    """The robot's own table below the twin's rows; patterns are relative to `namespace` unless they begin with / or **.

    Raises NameError_ for a pattern that is too long with the namespace before it.
    """

    def __init__(self, own: TopicTable, rows: Sequence[TopicSpec], *, namespace: str) -> None:
        super().__init__(())
        self._own = own
        self._wanted = tuple((Glob(absolute(row.pattern, namespace)), row) for row in rows)

    def find(self, topic: str) -> TopicRule | None:
        """The robot's own row of the topic, and over it the first of the twin's that matches."""
        own = self._own.find(topic)
        row = next((row for glob, row in self._wanted if glob.matches(topic)), None)
        return own if row is None else laid_over(own or TopicRule(match=row.pattern), row)


def absolute(pattern: str, namespace: str) -> str:
    """A pattern as it stands for whole names of topics."""
    return pattern if pattern.startswith(("/", "**")) else f"{namespace.rstrip('/')}/{pattern}"


def laid_over(own: TopicRule, row: TopicSpec) -> TopicRule:
    """The robot's own row with what the twin's gives."""
    fields: dict[str, Any] = {key: getattr(row, key) for key in KEYS if key in row.given}
    if "class" in row.given:
        fields["delivery"] = row.delivery
    if "rate_hz" in row.given:
        fields["max_rate_hz"] = row.rate_hz
    if own.sealed:
        fields.pop("fields", None)
    rule = replace(own, **fields)
    if rule.history_hz and (rule.delivery in ("event", "bulk") or not rule.forward):
        rule = replace(rule, history_hz=0.0)
    if rule.latest_only and rule.delivery == "event":
        rule = replace(rule, latest_only=False)
    return rule
