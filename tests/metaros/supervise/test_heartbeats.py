"""Heartbeats: the pure pulse, the port that hears them, and a node that hangs."""

from __future__ import annotations

import asyncio
import socket

from metaros.clock import ManualClock
from metaros.supervise.heartbeats import HeartbeatMonitor, HeartbeatPort
from tests.support.waiting import wait_until_async


def test_nothing_is_judged_before_the_first_beat() -> None:
    pulse = HeartbeatMonitor(2.0)
    assert not pulse.beating
    assert not pulse.hung(1e9)


def test_three_missed_beats_are_a_hang() -> None:
    pulse = HeartbeatMonitor(2.0)
    pulse.beat("+1", 10.0)
    assert not pulse.hung(16.0)
    assert pulse.hung(16.1)
    pulse.beat("+1", 16.2)
    assert not pulse.hung(16.3)


def test_one_stuck_node_of_several_is_seen_and_one_that_left_is_not_missed() -> None:
    pulse = HeartbeatMonitor(1.0)
    pulse.beat("+1", 0.0)
    pulse.beat("+2", 0.0)
    pulse.beat("+1", 5.0)
    assert pulse.silence_s(5.0) == 5.0
    assert pulse.hung(5.0)
    pulse.beat("-2", 5.0)
    assert not pulse.hung(5.0)


def test_what_makes_no_sense_is_ignored_and_the_number_of_nodes_is_bounded() -> None:
    pulse = HeartbeatMonitor(1.0)
    for word in ("", "x", "1"):
        pulse.beat(word, 0.0)
    assert not pulse.beating
    for number in range(1000):
        pulse.beat(f"+{number}", 0.0)
    pulse.beat("+0", 9.0)
    assert len(pulse._last) == 256


async def test_the_port_hears_only_those_it_knows() -> None:
    clock = ManualClock()
    port, pulse = HeartbeatPort(clock.monotonic_s), HeartbeatMonitor(2.0)
    await port.open()
    try:
        token, where = port.register(pulse)
        host, number, reported, period = where.split(":")
        assert (reported, period) == (token, "2")
        with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as sender:
            for text in ("nobody +9", "\xff", f"{token} +1"):
                sender.sendto(text.encode("latin-1"), (host, int(number)))
            await wait_until_async(lambda: pulse.beating)
            assert list(pulse._last) == ["1"]
            port.forget(token)
            sender.sendto(f"{token} +2".encode(), (host, int(number)))
        await asyncio.sleep(0)
        assert list(pulse._last) == ["1"]
    finally:
        port.close()
