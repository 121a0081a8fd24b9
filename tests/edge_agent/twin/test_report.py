"""Reports: once on every link, on change, not too often, and never too long."""

from __future__ import annotations

import json
from typing import Any

from edge_agent.twin.confirm import CommitConfirm
from edge_agent.twin.record import Record
from edge_agent.twin.report import LOOK_S, Reporter, bounded
from metaros._proto import link_pb2
from metaros.clock import ManualClock
from metaros.limits import LIMITS


class Rig:
    """A reporter, what it is told, and what it says."""

    def __init__(self) -> None:
        self.clock = ManualClock()
        self.facts: dict[str, Any] = {"nodes": {}}
        self.sent: list[link_pb2.TwinReport] = []
        confirm = CommitConfirm(Record(seen=3, undone="refused", code="c", message="m" * 5000), self.clock, boot_id="b")
        self.reporter = Reporter(confirm, lambda: self.facts, self.clock)

    def up(self) -> None:
        self.reporter.link(lambda frame: self.sent.append(frame.twin))

    def after(self, seconds: float) -> bool:
        self.clock.advance(seconds)
        return self.reporter.send()


def test_each_link_hears_one_and_none_is_sent_without_a_link() -> None:
    rig = Rig()
    assert not rig.after(1.0)
    assert rig.reporter.wait_s() is None
    rig.up()
    assert rig.reporter.wait_s() == 0.0
    assert rig.after(0.0)
    (report,) = rig.sent
    assert (report.revision, report.applied, report.state, report.code) == (3, 0, "refused", "c")
    assert len(report.message) == 1024
    assert json.loads(report.reported) == {"nodes": {}}
    rig.reporter.link(None)
    rig.reporter.mark_changed()
    assert not rig.after(1.0)
    rig.up()
    assert rig.after(0.0)


def test_changes_come_half_a_second_apart_the_newest_only() -> None:
    rig = Rig()
    rig.up()
    rig.after(0.0)
    for number in range(40):
        rig.facts = {"nodes": {"n": number}}
        rig.reporter.mark_changed()
        rig.after(0.05)
    assert 3 <= len(rig.sent) <= 5
    rig.after(LIMITS.twin_report_s)
    assert json.loads(rig.sent[-1].reported) == {"nodes": {"n": 39}}


def test_what_did_not_change_is_not_sent_but_where_it_is_asked_for() -> None:
    rig = Rig()
    rig.up()
    rig.after(0.0)
    rig.reporter.mark_changed()
    assert not rig.after(1.0)
    assert not rig.after(LOOK_S)
    rig.reporter.ask()
    assert rig.after(1.0)


def test_what_changes_without_a_word_is_seen_by_and_by() -> None:
    rig = Rig()
    rig.up()
    rig.after(0.0)
    rig.facts = {"nodes": {"n": 1}}
    assert not rig.after(1.0)
    wait_s = rig.reporter.wait_s()
    assert wait_s is not None
    assert rig.after(wait_s)


def test_a_report_is_bounded_and_says_what_it_is_without() -> None:
    facts = {"agent": {"version": "1"}, "nodes": {"a": {}}, "parameters": {"/n": "x" * 5000}, "budget": {}}
    assert json.loads(bounded(facts, 1 << 20)) == facts
    assert json.loads(bounded(facts, 500)) == {
        "agent": {"version": "1"},
        "nodes": {"a": {}},
        "budget": {},
        "left_out": ["parameters"],
    }
    large = dict.fromkeys((*facts, "unknown"), "y" * 600)
    assert len(bounded(large, 500)) <= 500
    assert len(bounded({f"section_{n}": "x" * 99 for n in range(9999)}, LIMITS.twin_reported_bytes)) <= 256 * 1024
