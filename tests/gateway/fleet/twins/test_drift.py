"""Drift of a twin: told when nodes that were as desired are so no more, and not for what a change brings about."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import orjson

from gateway.automation.events.kinds import event_kind
from gateway.domain.fleet.twin import Desired, Reported
from gateway.fleet.twins.cache import TwinCache
from gateway.fleet.twins.drift import Drift

DOCUMENT = orjson.dumps({"nodes": {"camera": {"allowed": "camera"}, "arm": {"allowed": "arm", "run": False}}})


class World:
    """One robot, what is desired of it, and what was told."""

    def __init__(self, document: bytes = DOCUMENT) -> None:
        self.cache = TwinCache(None)  # type: ignore[arg-type]  # its store is asked for nothing
        self.told: list[tuple[str, dict[str, Any]]] = []
        self.drift = Drift(self.cache, self._emit, holder_of=lambda robot, node: None)
        self.desire(7, document)

    def _emit(self, kind: str, robot: str, data: Mapping[str, Any]) -> None:
        assert robot == "r1"
        assert set(data) == set(event_kind(kind).data)
        self.told.append((kind, dict(data)))

    def desire(self, revision: int, document: bytes = DOCUMENT) -> None:
        self.cache.learn([Desired(robot="r1", revision=revision, change=revision, document=document)])

    def report(self, *reports: Reported) -> list[str]:
        """The kinds of events that they set off, one after the other."""
        self.told.clear()
        before: Reported | None = None
        for after in reports:
            self.drift.on_report(before, after)
            before = after
        return [kind for kind, _ in self.told]


def said(camera: str, *, arm: str = "stopped", revision: int = 7, state: str = "applied", **more: Any) -> Reported:
    nodes = {"camera": {"state": camera, "last_exit": "signal 9", **more}, "arm": {"state": arm}}
    values = orjson.dumps({"nodes": nodes})
    return Reported(robot="r1", at_ns=1, revision=revision, applied=revision, state=state, reported=values)


def test_drift_is_reported_when_it_begins_and_when_it_ends() -> None:
    world = World()
    reports = said("running"), said("waiting"), said("waiting", restarts=1), said("running")
    assert world.report(*reports) == ["twin.drifted", "twin.in_step"]
    drifted = world.told[0][1]
    assert (drifted["revision"], drifted["count"]) == (7, 1)
    [node] = drifted["nodes"]
    assert (node["node"], node["what"], node["desired"], node["reported"]) == ("camera", "state", "running", "waiting")
    assert "signal 9" in node["why"]


def test_a_node_that_runs_unasked_is_drift_too() -> None:
    assert World().report(said("running"), said("running", arm="running")) == ["twin.drifted"]


def test_what_a_change_brings_about_is_no_drift() -> None:
    world = World()
    assert world.report(said("running", revision=6), said("starting")) == []
    assert world.report(said("running"), said("starting", state="applying")) == []
    world.desire(8)
    assert world.report(said("running"), said("stopped")) == []  # it has not heard of revision 8 yet


def test_what_was_never_as_desired_has_not_drifted_and_arrives() -> None:
    assert World().report(said("starting"), said("waiting"), said("running")) == ["twin.in_step"]


def test_a_report_without_nodes_and_a_twin_without_any_say_nothing() -> None:
    short = Reported(robot="r1", at_ns=1, revision=7, applied=7, state="applied", reported=b'{"left_out":["nodes"]}')
    assert World().report(said("running"), short, said("waiting"), short) == []
    assert World(b"{}").report(said("running"), said("waiting")) == []
