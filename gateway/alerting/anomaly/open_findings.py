"""The findings that are open now. Several features may report one: it opens with the first and clears with the last."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import asdict, replace
from typing import Any

from gateway.domain.finding import Edge, Finding, FindingSeverity

__all__ = ["OpenFindings"]

Key = tuple[str, str, str]


class OpenFindings:
    """Open findings and who holds them open; edges are collected until they are taken."""

    def __init__(self) -> None:
        self._open: dict[Key, tuple[Finding, list[str]]] = {}
        self._of: dict[str, set[Key]] = {}
        self._edges: list[Edge] = []

    def open(self, finding: Finding, source: str, *, at_s: float) -> None:
        """A source tells a finding; of one that is open already the first words stay."""
        held = self._open.get(finding.key)
        if held is not None:
            if source not in held[1]:
                held[1].append(source)
            return
        self._open[finding.key] = (finding, [source])
        self._of.setdefault(finding.robot, set()).add(finding.key)
        self._edges.append(Edge("opened", finding, at_s))

    def close(self, key: Key, source: str, *, at_s: float) -> None:
        """A source does not tell it any more."""
        held = self._open.get(key)
        if held is None or source not in held[1]:
            return
        held[1].remove(source)
        if not held[1]:
            self._drop(key)
            self._edges.append(Edge("cleared", held[0], at_s))

    def clear(self, robot: str, kinds: Iterable[str], *, at_s: float, series: str | None = None) -> None:
        """All of these kinds of a robot, or of one of its series, are over."""
        wanted = set(kinds)
        for key in sorted(self._of.get(robot, ())):
            if key[2] in wanted and series in (None, key[1]):
                finding = self._open[key][0]
                self._drop(key)
                self._edges.append(Edge("cleared", finding, at_s))

    def grade(self, robot: str, severities: Mapping[str, FindingSeverity], *, at_s: float) -> None:
        """How severe the robot's findings of some kinds are from now on."""
        for key in sorted(self._of.get(robot, ())):
            finding, sources = self._open[key]
            severity = severities.get(key[2], finding.severity)
            if severity != finding.severity:
                self._open[key] = (replace(finding, severity=severity), sources)
                self._edges.append(Edge("changed", self._open[key][0], at_s))

    def robots(self) -> list[str]:
        """Who has anything open."""
        return sorted(self._of)

    def holds(self, key: Key) -> bool:
        """Whether it is open."""
        return key in self._open

    def forget(self, robot: str) -> None:
        """Nothing of the robot is open, and nobody is told."""
        for key in list(self._of.get(robot, ())):
            self._drop(key)
        self._edges = [edge for edge in self._edges if edge.finding.robot != robot]

    def take(self) -> list[Edge]:
        """The edges since the last call."""
        edges, self._edges = self._edges, []
        return edges

    def all(self, robot: str | None = None) -> list[Finding]:
        """What is open, of one robot or of all."""
        keys = sorted(self._of.get(robot, ())) if robot is not None else list(self._open)
        return [self._open[key][0] for key in keys]

    def dump(self, robot: str | None = None) -> list[Any]:
        """As JSON takes it, of one robot or of all; edges that were not taken are not kept."""
        keys = self._open if robot is None else sorted(self._of.get(robot, ()))
        return [[asdict(finding), sources] for finding, sources in (self._open[key] for key in keys)]

    def load(self, dumped: list[Any]) -> None:
        """Take over what `dump` gave. Raises TypeError and ValueError."""
        for fields, sources in dumped:
            finding = Finding(**fields)
            self._open[finding.key] = (finding, list(sources))
            self._of.setdefault(finding.robot, set()).add(finding.key)

    def _drop(self, key: Key) -> None:
        del self._open[key]
        self._of[key[0]].discard(key)
        if not self._of[key[0]]:
            del self._of[key[0]]
