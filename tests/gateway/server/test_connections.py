"""Who is connected: how many, who goes for whom, and who is late."""

from __future__ import annotations

import asyncio
from dataclasses import replace
from typing import Any

from gateway.server.connections import Connection, ConnectionLimits
from metaros.clock import ManualClock
from metaros.limits import LIMITS


class Transport(asyncio.Transport):
    """A connection that is open until it is aborted."""

    def __init__(self, address: str) -> None:
        super().__init__({"peername": (address, 5000)})
        self.aborted = self.closing = False
        self.size = 0

    def abort(self) -> None:
        """Cut."""
        self.aborted = True

    def is_closing(self) -> bool:
        """Whether it was closed."""
        return self.closing

    def get_write_buffer_size(self) -> int:
        """What the other end has not taken."""
        return self.size


def connection_limits(clock: ManualClock, **bounds: Any) -> ConnectionLimits:
    """A small port; addresses of 127. are this machine's."""
    limits = replace(LIMITS, **{"connections": 8, "connections_address": 3, **bounds})
    return ConnectionLimits(clock=clock, limits=limits, is_shared=lambda address: address.startswith("127."))


def came(port: ConnectionLimits, address: str) -> Connection:
    """A connection that got in."""
    connection = port.add(Transport(address))
    assert connection is not None
    return connection


def gone(connection: Connection) -> bool:
    """Whether it was cut."""
    assert isinstance(connection.transport, Transport)
    return connection.transport.aborted


def test_the_longest_waiting_one_of_an_address_makes_room_for_its_next() -> None:
    port = connection_limits(ManualClock())
    first, second, third = (came(port, "10.0.0.1") for _ in range(3))
    other = came(port, "10.0.0.2")
    port.mark_busy(first)
    came(port, "10.0.0.1")
    assert [gone(connection) for connection in (first, second, third, other)] == [False, True, False, False]
    assert len(port) == 4


def test_where_all_are_busy_the_new_one_goes() -> None:
    port = connection_limits(ManualClock())
    busy = [came(port, "10.0.0.1") for _ in range(3)]
    for connection in busy:
        port.mark_busy(connection)
    assert port.add(Transport("10.0.0.1")) is None
    port.remove(busy[0])
    came(port, "10.0.0.1")


def test_this_machine_has_more_room_and_never_all_of_it() -> None:
    port = connection_limits(ManualClock())
    local = [came(port, "127.0.0.1") for _ in range(6)]
    for connection in local:
        port.mark_busy(connection)
    assert port.add(Transport("127.0.0.1")) is None
    came(port, "10.0.0.1")
    came(port, "10.0.0.2")
    came(port, "10.0.0.3")
    assert len(port) == 8


def test_files_bound_it_too_and_a_network_is_one_address() -> None:
    port = ConnectionLimits(clock=ManualClock(), files=20)
    for number in range(30):
        came(port, f"10.0.0.{number}")
    assert len(port) == 10
    port = connection_limits(ManualClock())
    for number in range(5):
        came(port, f"2001:db8::{number}")
    assert len(port) == 3


def test_who_is_late_is_cut_and_who_works_is_not() -> None:
    clock = ManualClock()
    port = connection_limits(clock)
    late, busy, resting = came(port, "10.0.0.1"), came(port, "10.0.0.2"), came(port, "10.0.0.3")
    port.mark_busy(busy)
    port.mark_idle(resting, LIMITS.keep_alive_s)
    clock.advance(LIMITS.head_s)
    port.sweep()
    assert [gone(connection) for connection in (late, busy, resting)] == [True, False, False]
    clock.advance(LIMITS.keep_alive_s)
    port.sweep()
    assert [gone(connection) for connection in (busy, resting)] == [False, True]
    assert len(port) == 1


def test_who_takes_nothing_of_an_answer_is_cut_and_who_takes_some_is_not() -> None:
    clock = ManualClock()
    port = connection_limits(clock)
    dead, slow, closing, busy = (came(port, f"10.0.0.{number}") for number in range(4))
    for connection in (dead, slow, closing, busy):
        port.mark_busy(connection)
        connection.transport.size = 10_000_000  # type: ignore[attr-defined]
    dead.write_paused = slow.write_paused = True
    closing.transport.closing = True  # type: ignore[attr-defined]
    for _ in range(40):
        clock.advance(5.0)
        slow.transport.size -= 20_000  # type: ignore[attr-defined]
        port.sweep()
    assert [gone(connection) for connection in (dead, slow, closing, busy)] == [True, False, True, False]


def test_leaving_twice_counts_once_and_close_ends_all() -> None:
    port = connection_limits(ManualClock())
    first, second = came(port, "10.0.0.1"), came(port, "10.0.0.1")
    port.remove(first)
    port.remove(first)
    port.mark_idle(first, 1.0)
    port.mark_busy(first)
    assert len(port) == 1
    port.close()
    assert gone(second)
    assert len(port) == 0
