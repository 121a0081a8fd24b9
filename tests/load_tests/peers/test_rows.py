"""Which rows and cells a run has."""

from __future__ import annotations

import importlib.util

import pytest

from load_tests.peers.rows import ROWS, SIZES, UnknownRow, chosen, pings_of, planned, size_name
from load_tests.peers.venvs import HOMES


def test_rows_name_modules_and_homes_that_there_are() -> None:
    assert len({row.key for row in ROWS}) == len(ROWS)
    assert {row.home for row in ROWS} == set(HOMES) - {"river"}  # which is compared with elsewhere
    assert [row.module for row in ROWS if importlib.util.find_spec(f"load_tests.peers.{row.module}") is None] == []


def test_only_names_peers_and_rows() -> None:
    assert chosen([]) == list(ROWS)
    assert [row.key for row in chosen(["pyzmq", "metaros-bytes"])] == ["metaros-bytes", "pyzmq"]
    assert {row.peer for row in chosen(["metaros"])} == {"metaros"}
    with pytest.raises(UnknownRow, match="unknown peer nobody; there are: zenoh"):
        chosen(["nobody"])


def test_shared_memory_is_for_large_payloads() -> None:
    cells = planned(chosen(["zenoh-shm"]), SIZES)
    assert [size for size, _ in cells] == [65536, 1 << 20, 6220800]


@pytest.mark.parametrize(
    ("size", "name"),
    [(64, "64 B"), (1024, "1 KiB"), (65536, "64 KiB"), (1 << 20, "1 MiB"), (1000, "1000 B")],
)
def test_names_of_sizes(size: int, name: str) -> None:
    assert size_name(size) == name


def test_small_payloads_have_two_thousand_round_trips() -> None:
    assert pings_of(64) == pings_of(1024) == 2000
    assert pings_of(6220800) < pings_of(1 << 20) < 2000
