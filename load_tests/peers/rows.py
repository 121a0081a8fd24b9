"""The rows of the table: who is measured, how, and at which payload sizes."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass

__all__ = ["QUICK_SIZES", "ROWS", "SIZES", "Row", "UnknownRow", "chosen", "pings_of", "planned", "size_name"]

IMAGE_1080P = 1920 * 1080 * 3
SIZES = (64, 1024, 65536, 1 << 20, IMAGE_1080P)
QUICK_SIZES = (64, 1 << 20)
_LARGE = 65536
_PINGS = ((1024, 2000), (65536, 1000), (1 << 20, 300))
_FEW_PINGS = 60


@dataclass(frozen=True, slots=True, kw_only=True)
class Row:
    """One way to send a payload from one process to another."""

    key: str
    peer: str
    label: str
    module: str
    mode: str = ""
    home: str = "ours"  # whose Python runs it: see venvs.py
    brokered: bool = False
    smallest: int = 0
    quick: bool = True
    ping_pause_s: float = 0.0  # between round trips, where the peer would lose one that follows at once


class UnknownRow(ValueError):
    """A name after --only that is neither a peer nor a row."""


ROWS = (
    Row(key="zenoh", peer="zenoh", label="zenoh, 33 B attachment", module="raw_zenoh", mode="attachment"),
    Row(key="zenoh-bare", peer="zenoh", label="zenoh, bare", module="raw_zenoh", mode="bare", quick=False),
    Row(key="zenoh-tuned", peer="zenoh", label="zenoh, our settings", module="raw_zenoh", mode="tuned", quick=False),
    Row(key="zenoh-shm", peer="zenoh", label="zenoh, shared memory", module="raw_zenoh", mode="shm", smallest=_LARGE),
    Row(key="metaros-executor", peer="metaros", label="metaros typed", module="metaros_two", mode="executor"),
    Row(key="metaros-all", peer="metaros", label="metaros typed, keep-all", module="metaros_two", mode="executor-all"),
    Row(
        key="metaros-dedicated",
        peer="metaros",
        label="metaros typed, dedicated",
        module="metaros_two",
        mode="dedicated",
    ),
    Row(key="metaros-bytes", peer="metaros", label="metaros bytes, dedicated", module="metaros_two", mode="bytes"),
    Row(
        key="metaros-shm",
        peer="metaros",
        label="metaros typed, shared memory",
        module="metaros_two",
        mode="dedicated+shm",
        smallest=_LARGE,
    ),
    Row(key="cyclonedds", peer="cyclonedds", label="cyclonedds-python 11.0.1", module="cyclone", home="peers"),
    Row(key="pyzmq", peer="pyzmq", label="pyzmq 27.3.0", module="zmq_sockets", home="peers"),
    Row(
        key="metaros1",
        peer="metaros1",
        label="metaros 1.1.5 (PyPI)",
        module="metaros_one",
        home="metaros1",
        brokered=True,
        ping_pause_s=0.12,
    ),
    Row(key="rospy", peer="rospy", label="rospy (Debian)", module="rospy_node", home="rospy", brokered=True),
)


def chosen(only: Iterable[str], *, quick: bool = False) -> list[Row]:
    """The rows of the named peers and rows; without names all, or those of a quick run."""
    names = set(only)
    unknown = names - {row.key for row in ROWS} - {row.peer for row in ROWS}
    if unknown:
        known = dict.fromkeys([*(row.peer for row in ROWS), *(row.key for row in ROWS)])
        raise UnknownRow(f"unknown peer {', '.join(sorted(unknown))}; there are: {', '.join(known)}")
    if not names:
        return [row for row in ROWS if row.quick or not quick]
    return [row for row in ROWS if {row.key, row.peer} & names]


def pings_of(size: int) -> int:
    """How many round trips a round has at this size."""
    return next((count for limit, count in _PINGS if size <= limit), _FEW_PINGS)


def size_name(size: int) -> str:
    """As in the headings: 64 B, 1 KiB, 1 MiB, 1080p."""
    if size == IMAGE_1080P:
        return "1080p image (5.9 MiB)"
    for unit, bytes_each in (("MiB", 1 << 20), ("KiB", 1 << 10)):
        if size % bytes_each == 0 and size:
            return f"{size // bytes_each} {unit}"
    return f"{size} B"


def planned(rows: Sequence[Row], sizes: Sequence[int]) -> list[tuple[int, Row]]:
    """Every cell of one round."""
    return [(size, row) for size in sizes for row in rows if size >= row.smallest]
