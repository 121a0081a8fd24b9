"""Scenarios: each is said once, and played by us and each peer, in both directions, as far as the peer can."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import Any

import pytest

from tests.ros2.cast import OURS, PEERS

__all__ = ["Report", "Scenario", "report", "scenario"]


@dataclass(frozen=True)
class Scenario:
    """`told` is what the teller needs, `heard` what the hearer needs; the other one is any of ours."""

    title: str
    told: str
    heard: str


def scenario(title: str, *, told: str, heard: str) -> Callable[[Callable[..., None]], Callable[..., None]]:
    """A test that takes `teller` and `hearer`: one of ours and one peer."""

    def mark(test: Callable[..., None]) -> Callable[..., None]:
        test.__dict__["scenario"] = Scenario(title, told, heard)
        return test

    return mark


class Report:
    """What was checked with whom, for the table at the end of `make conformance`."""

    def __init__(self) -> None:
        self._cells: dict[tuple[str, str, str], list[str]] = {}  # outcomes by title, direction and peer
        self._whys: dict[tuple[str, str, str], str] = {}
        self._ids: dict[str, tuple[str, str, str]] = {}

    def plan(self, metafunc: pytest.Metafunc) -> None:
        """Give a scenario its pairs."""
        played: Scenario = metafunc.function.scenario
        pairs = []
        for told_by, need in (("us", played.heard), ("peer", played.told)):
            for peer in PEERS:
                cell = (played.title, told_by, peer.name)
                if need in peer.cannot:
                    self._whys[cell] = peer.cannot[need]
                    continue
                for ours in OURS:
                    if (played.told if told_by == "us" else played.heard) in ours.cannot:
                        continue
                    pair = (ours.name, peer.name) if told_by == "us" else (peer.name, ours.name)
                    marks = () if ours.name in peer.desk else (pytest.mark.integration,)
                    pairs.append(pytest.param(*pair, id="-to-".join(pair), marks=marks))
                    self._ids[f"{metafunc.function.__name__}[{'-to-'.join(pair)}]"] = cell
        metafunc.parametrize(("teller", "hearer"), pairs, indirect=True)

    def note(self, outcome: pytest.TestReport) -> None:
        """How a test went."""
        cell = self._ids.get(outcome.nodeid.partition("::")[2].partition("@")[0])
        if cell is not None and (outcome.when == "call" or outcome.outcome == "failed"):
            self._cells.setdefault(cell, []).append(outcome.outcome)

    def lines(self) -> Iterator[str]:
        """The table, and why what is missing is."""
        titles = list(dict.fromkeys(cell[0] for cell in (*self._ids.values(), *self._whys)))
        notes = list(dict.fromkeys(self._whys.values()))
        width = max(map(len, titles), default=0)
        yield f"{'':{width}}  told by  " + "".join(f"{peer.name:<12}" for peer in PEERS)
        for title in titles:
            for told_by in ("us", "peer"):
                row = [self._cell((title, told_by, peer.name), notes) for peer in PEERS]
                yield f"{title:{width}}  {told_by:7}  " + "".join(f"{text:<12}" for text in row).rstrip()
        for number, why in enumerate(notes, 1):
            yield f"[{number}] not possible: {why}"

    def _cell(self, cell: tuple[str, str, str], notes: list[str]) -> str:
        if cell in self._whys:
            return f"[{notes.index(self._whys[cell]) + 1}]"
        outcomes = self._cells.get(cell, [])
        if not outcomes:
            return "not run"
        failed = [outcome for outcome in outcomes if outcome != "passed"]
        return f"FAILED {len(failed)}" if failed else f"passed {len(outcomes)}"


report: Any = Report()
