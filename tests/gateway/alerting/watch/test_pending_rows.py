"""Rows between the writer and the evaluator: each is taken once, whatever came twice, in the order of its number."""

from __future__ import annotations

from gateway.alerting.watch.entries import Mark
from gateway.alerting.watch.pending_rows import PendingRows
from tests.gateway.alerting.watch.made import entry

R1: Mark = ("r1", 0, 7)
R2: Mark = ("r2", 0, 7)


def taken(pending: PendingRows, marks: dict[Mark, int]) -> list[float]:
    return [value for found, span in pending.take(marks) for value in found.values[span].tolist()]


def test_only_what_is_committed_is_taken() -> None:
    pending = PendingRows()
    pending.add(entry(1, 10))
    pending.add(entry(11, 10))
    assert taken(pending, {R1: 10}) == list(range(1, 11))
    assert taken(pending, {}) == []
    assert taken(pending, {R2: 99}) == []
    assert pending.rows == 10
    assert taken(pending, {R1: 20}) == list(range(11, 21))
    assert pending.rows == 0


def test_a_write_may_be_committed_in_parts() -> None:
    pending = PendingRows()
    pending.add(entry(1, 10))
    assert taken(pending, {R1: 4}) == [1, 2, 3, 4]
    assert taken(pending, {R1: 10}) == [5, 6, 7, 8, 9, 10]
    assert pending.rows == 0


def test_what_was_given_up_and_comes_again_cut_otherwise_is_taken_once() -> None:
    pending = PendingRows()
    for first_seq, count in ((1, 5), (6, 5), (11, 5)):
        pending.add(entry(first_seq, count))
    for first_seq, count in ((1, 8), (9, 12)):
        pending.add(entry(first_seq, count))
    assert taken(pending, {R1: 20}) == list(range(1, 21))
    assert taken(pending, {R1: 20}) == []
    assert pending.rows == 0


def test_numbers_that_were_lost_are_passed_over() -> None:
    pending = PendingRows()
    pending.add(entry(1, 2))
    assert taken(pending, {R1: 2}) == [1, 2]
    assert taken(pending, {R1: 50}) == []
    pending.add(entry(40, 20))  # of which a gap had declared those up to 50
    assert taken(pending, {R1: 59}) == list(range(51, 60))


def test_streams_and_epochs_do_not_meet() -> None:
    pending = PendingRows()
    pending.add(entry(1, 3))
    pending.add(entry(1, 3, epoch=8))
    pending.add(entry(1, 3, robot="r2"))
    assert taken(pending, {R1: 3}) == [1, 2, 3]
    assert taken(pending, {R2: 3}) == [1, 2, 3]
    assert [found.epoch for found in pending.entries()] == [8]


def test_more_than_the_bound_is_left_out_the_oldest_first() -> None:
    pending = PendingRows(max_rows=100)
    for number in range(30):
        pending.add(entry(1 + 10 * number, 10, robot=f"r{number % 2 + 1}"))
    assert pending.rows == 100
    assert pending.dropped == 200
    left = taken(pending, {R1: 300, R2: 300})
    assert sorted(left) == list(range(201, 301))
    for number in range(50):  # it goes on for ever in the same memory
        pending.add(entry(1000 + 10 * number, 10))
        assert taken(pending, {R1: 1009 + 10 * number}) == list(range(1000 + 10 * number, 1010 + 10 * number))
    assert pending.rows == 0


def test_what_waits_may_be_added_remote() -> None:
    pending, other = PendingRows(), PendingRows()
    for first_seq in (1, 4, 7):
        pending.add(entry(first_seq, 3))
    pending.take({R1: 5})
    for waiting in pending.entries():
        other.add(waiting)
    other.judged.update(pending.judged)
    assert taken(other, {R1: 9}) == taken(pending, {R1: 9}) == [6, 7, 8, 9]
