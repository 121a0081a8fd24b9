"""Simulated faults."""

from __future__ import annotations

from metaros.clock import system_rng
from metaros.drivers.faults import FAULTS, FaultBox


def test_each_begins_and_all_end() -> None:
    box = FaultBox(system_rng())
    assert all(box.inject(name) for name in FAULTS)
    assert box.on == set(FAULTS)
    assert not box.inject("fire")
    assert box.inject("clear")
    assert not box.on


def test_garble_changes_a_few_bytes_and_no_length() -> None:
    box = FaultBox(system_rng())
    data = bytes(1000)
    assert box.garbled(data) == data
    box.inject("garble")
    wrong = [box.garbled(data) for _ in range(20)]
    assert any(data != other for other in wrong)
    assert all(len(other) == 1000 and sum(byte != 0 for byte in other) <= 6 for other in wrong)
    assert box.garbled(b"") == b""
