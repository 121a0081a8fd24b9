"""Moments of the robot's clock: only those of this link count."""

from __future__ import annotations

from edge_agent.nodes.lease_stamps import LeaseStamps


def test_what_was_reported_over_this_link_is_known() -> None:
    stamps = LeaseStamps()
    assert not stamps.knows(0)
    assert stamps.issue(5) == 5
    assert stamps.issue(9) == 9
    assert [stamps.knows(since) for since in (0, 4, 5, 7, 9, 10)] == [False, False, True, True, True, False]


def test_another_link_knows_nothing_of_the_one_before() -> None:
    stamps = LeaseStamps()
    stamps.issue(5)
    stamps.forget()
    assert not stamps.knows(5)
    stamps.issue(2)  # the machine has started again: its clock, too
    assert not stamps.knows(5)
    assert stamps.knows(2)
