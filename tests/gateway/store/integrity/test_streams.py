"""Numbers of a stream against its watermark: pure."""

from __future__ import annotations

from gateway.store.integrity.streams import Interval, audit


def row(first_seq: int, last_seq: int, channel: int = 3) -> Interval:
    """Stored samples."""
    return Interval(first_seq, last_seq, first_seq * 10, last_seq * 10, channel)


def loss(first_seq: int, last_seq: int) -> Interval:
    """A declared loss."""
    return Interval(first_seq, last_seq, 0, 0, None)


def faults(intervals: list[Interval], watermark: int) -> list[tuple[str, int, int]]:
    """What is wrong."""
    return [item[:3] for item in audit(sorted(intervals), watermark)]


def test_sound_streams() -> None:
    assert faults([row(1, 5), row(6, 6), loss(7, 9), row(10, 12)], 12) == []
    assert faults([], 50) == []
    assert faults([loss(1, 9)], 50) == []  # its samples were all purged
    assert faults([loss(1, 4), row(20, 30)], 30) == []  # those between were
    assert faults([row(20, 30), loss(31, 31)], 31) == []
    assert faults([loss(1, 9), loss(3, 5), row(10, 10)], 10) == []


def test_holes() -> None:
    assert faults([row(1, 5), row(8, 9)], 9) == [("hole", 6, 7)]
    assert faults([row(1, 5), loss(6, 6), row(8, 9), row(12, 12)], 12) == [("hole", 7, 7), ("hole", 10, 11)]
    assert faults([row(1, 5)], 8) == [("hole", 6, 8)]


def test_twice_and_ahead() -> None:
    assert faults([row(1, 5), row(5, 9)], 9) == [("twice", 5, 5)]
    assert faults([row(1, 9), row(3, 4), row(10, 10)], 10) == [("twice", 3, 4)]
    assert faults([row(1, 9), loss(9, 12)], 12) == [("twice", 9, 9)]
    assert faults([loss(1, 9), row(8, 12)], 12) == [("twice", 8, 9)]
    assert faults([row(1, 9)], 7) == [("ahead", 8, 9)]
