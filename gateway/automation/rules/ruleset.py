"""All rules that are on, arranged so that what comes finds those that are about it. Never changed once it is made:
another one takes its place.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import Any

from gateway.automation.rules.metric_event import series_group
from gateway.automation.rules.rule import Rule
from metaros.automation.rules.index import PatternIndex
from metaros.idl.globs import Glob

__all__ = ["NOTHING", "Ruleset"]

UNTIL = "\0until"  # behind a rule's name: the key of the pattern that ends what it waits for
MOST_KNOWN = 65_536  # topics, and series, of robots whose rules are remembered


class Ruleset:
    """`rules` by name; lookups are any one thread's."""

    def __init__(self, rules: Iterable[Rule] = ()) -> None:
        self.rules: dict[str, Rule] = {rule.name: rule for rule in rules if rule.enabled}
        self._index = PatternIndex()
        self._topics = [(Glob(one.topic.topic), one) for one in self.rules.values() if one.topic is not None]
        self._metrics = [
            (Glob(one.metric.series, separator="."), one) for one in self.rules.values() if one.metric is not None
        ]
        self._of_topic: dict[tuple[str, str], tuple[Rule, ...]] = {}
        self._of_series: dict[tuple[str, str], tuple[tuple[Rule, str], ...]] = {}
        for rule in self.rules.values():
            if rule.pattern is not None and rule.topic is None and rule.metric is None:
                self._index.put(rule.name, rule.pattern)
                if rule.until is not None:
                    self._index.put(rule.name + UNTIL, rule.until)

    @property
    def on_topics(self) -> bool:
        """Whether any rule is about samples."""
        return bool(self._topics)

    @property
    def on_metrics(self) -> bool:
        """Whether any rule is about values of series."""
        return bool(self._metrics)

    @property
    def on_events(self) -> bool:
        """Whether any rule is about other events."""
        return len(self._index) > 0

    def of_event(self, event: Mapping[str, Any], robot: str) -> dict[Rule, bool]:
        """The rules that an event is for: True where it counts, False where it ends what they wait for."""
        found: dict[Rule, bool] = {}
        for key in sorted(self._index.match(event)):
            rule = self.rules[key.removesuffix(UNTIL)]
            if rule.about(robot):
                found.setdefault(rule, not key.endswith(UNTIL))
        return found

    def of_topic(self, robot: str, topic: str) -> tuple[Rule, ...]:
        """The rules that samples of a robot's topic are for."""
        found = self._of_topic.get((robot, topic))
        if found is None:
            if len(self._of_topic) >= MOST_KNOWN:
                self._of_topic.clear()
            found = tuple(rule for glob, rule in self._topics if glob.matches(topic) and rule.about(robot))
            self._of_topic[robot, topic] = found
        return found

    def of_series(self, robot: str, series: str) -> tuple[tuple[Rule, str], ...]:
        """The rules that values of a robot's series are for, and the group that they belong to."""
        found = self._of_series.get((robot, series))
        if found is None:
            if len(self._of_series) >= MOST_KNOWN:
                self._of_series.clear()
            rules = [rule for glob, rule in self._metrics if glob.matches(series) and rule.about(robot)]
            found = tuple((rule, series_group(rule, robot, series)) for rule in rules)
            self._of_series[robot, series] = found
        return found


NOTHING = Ruleset()
