"""Limits on opening lanes: how many at a time, how often, and that it is forgotten."""

from __future__ import annotations

from contextlib import ExitStack
from dataclasses import replace

import pytest

from gateway.domain.identity import Peer
from gateway.errors import LinkBusyError
from gateway.ingest.lane_limits import LaneLimits
from metaros.clock import ManualClock
from metaros.limits import LIMITS

FAR, NEAR = Peer(address="10.0.0.1"), Peer(local=True, address="127.0.0.1")


def lane_limits(clock: ManualClock, **bounds: float) -> LaneLimits:
    """Doors with small bounds."""
    return LaneLimits(clock=clock, limits=replace(LIMITS, **bounds))  # type: ignore[arg-type]


def test_lanes_without_a_name_are_bounded_by_address_and_together() -> None:
    limits = lane_limits(ManualClock(), links_waiting=5, links_waiting_address=2)
    with ExitStack() as waiting:
        for _ in range(2):
            waiting.enter_context(limits.opening(FAR))
        with pytest.raises(LinkBusyError), limits.opening(FAR):
            pass
        for _ in range(3):
            waiting.enter_context(limits.opening(NEAR))
        with pytest.raises(LinkBusyError), limits.opening(NEAR):
            pass
    assert limits.opening_lanes == 0
    with limits.opening(FAR):
        assert limits.opening_lanes == 1


def test_an_address_knocks_at_a_rate_and_this_machine_as_often_as_it_likes() -> None:
    clock = ManualClock()
    limits = lane_limits(clock, links_address_per_s=1.0)
    for _ in range(10):
        with limits.opening(FAR):
            pass
    with pytest.raises(LinkBusyError) as refused, limits.opening(FAR):
        pass
    assert (refused.value.code, refused.value.retry_after_ms) == ("too_many_requests", 5000)
    for _ in range(1000):
        with limits.opening(NEAR):
            pass
    clock.advance(1.0)
    with limits.opening(FAR):
        pass


def test_a_robot_in_a_tight_loop_is_put_off_and_others_are_not() -> None:
    clock = ManualClock()
    limits = lane_limits(clock)
    for _ in range(200):
        limits.admitted("a")
    with pytest.raises(LinkBusyError, match="robot a"):
        limits.admitted("a")
    limits.admitted("b")
    clock.advance(1.0)
    limits.admitted("a")
