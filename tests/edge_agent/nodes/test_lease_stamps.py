"""Moments of the robot's clock: only those of this link count."""

from __future__ import annotations

from edge_agent.nodes.moments import Moments


def test_what_was_told_over_this_link_is_known() -> None:
    moments = Moments()
    assert not moments.knows(0)
    assert moments.tell(5) == 5
    assert moments.tell(9) == 9
    assert [moments.knows(since) for since in (0, 4, 5, 7, 9, 10)] == [False, False, True, True, True, False]


def test_another_link_knows_nothing_of_the_one_before() -> None:
    moments = Moments()
    moments.tell(5)
    moments.forget()
    assert not moments.knows(5)
    moments.tell(2)  # the machine has started again: its clock, too
    assert not moments.knows(5)
    assert moments.knows(2)
