"""Every sequence number is in the file, or in its account."""

from __future__ import annotations

import json
import random  # noqa: TID251

from hypothesis import given, settings
from hypothesis import strategies as st

from metaros.record.ledger import REASONS, Ledger, Publisher, Ranges


def publisher() -> Publisher:
    return Publisher("/scan", "sensor_msgs/msg/LaserScan", b"\x01" * 16)


def account(ledger: Ledger) -> dict:
    ((key, text),) = ledger.record().items()
    assert key == "/scan " + "01" * 16
    return json.loads(text)


def test_nothing_is_missing() -> None:
    ledger, one = Ledger(), publisher()
    for number in range(5, 10):
        ledger.note(one, number)
    assert account(ledger) == {
        "type": "sensor_msgs/msg/LaserScan",
        "first": 5,
        "last": 9,
        "received": 5,
        "before": 4,
    }
    assert ledger.counts() == {}


def test_each_gap_has_its_reason() -> None:
    ledger, one = Ledger(), publisher()
    ledger.note(one, 1)
    for number in (3, 4):
        one.refuse(number, "dropped")
    one.refuse(6, "paused")
    ledger.note(one, 8)
    found = account(ledger)
    assert (found["lost"], found["dropped"], found["paused"]) == ([[2, 2], [5, 5], [7, 7]], [[3, 4]], [[6, 6]])
    assert ledger.counts() == {"/scan": {"lost": 3, "dropped": 2, "paused": 1}}


def test_what_comes_late_or_twice() -> None:
    ledger, one = Ledger(), publisher()
    for number in (1, 4, 3, 4):
        ledger.note(one, number)
    found = account(ledger)
    assert (found["lost"], found["received"], found["again"]) == ([[2, 2]], 4, 1)


def test_refused_at_the_beginning_and_at_the_end() -> None:
    ledger, one = Ledger(), publisher()
    one.refuse(7, "paused")
    ledger.note(one, 8)
    one.refuse(9, "dropped")
    one.refuse(10, "dropped")
    ledger.close([one])
    found = account(ledger)
    assert (found["first"], found["last"], found["paused"], found["dropped"]) == (7, 10, [[7, 7]], [[9, 10]])


def test_a_publisher_of_which_nothing_was_written() -> None:
    ledger, one = Ledger(), publisher()
    one.refuse(3, "dropped")
    ledger.close([one])
    found = account(ledger)
    assert (found["first"], found["last"], found["received"], found["dropped"]) == (3, 3, 0, [[3, 3]])


def test_the_next_file_goes_on() -> None:
    first, second, one = Ledger(), Ledger(), publisher()
    first.note(one, 1)
    second.note(one, 4)
    assert account(second)["lost"] == [[2, 3]]
    fresh = Ledger(continues=False)
    fresh.note(one, 9)
    assert account(fresh)["first"] == 9


def test_what_is_taken_back_did_not_fit() -> None:
    ledger, one = Ledger(), publisher()
    for number in (1, 2, 3):
        ledger.note(one, number)
    ledger.take_back([(one, 2), (one, 3)])
    found = account(ledger)
    assert (found["received"], found["last"], found["disk"]) == (1, 3, [[2, 3]])


def test_ranges_are_bounded() -> None:
    ranges = Ranges()
    for number in range(0, 10_000, 2):
        ranges.add(number, number)
    assert len(ranges.pairs) == 1000
    assert ranges.folded
    assert ranges.pairs[-1][1] == 9998


@settings(deadline=None, max_examples=50)
@given(st.lists(st.integers(1, 200), unique=True, min_size=1), st.integers())
def test_numbers_add_up(numbers: list[int], seed: int) -> None:
    """Any subset in any order, with any refusals: written, reported, and nothing in both or in neither."""
    rng = random.Random(seed)
    ledger, one = Ledger(), publisher()
    refused = {number for number in numbers if rng.random() < 0.3}
    for number in sorted(numbers):
        if number in refused:
            one.refuse(number, rng.choice(["dropped", "paused"]))
    written = [number for number in numbers if number not in refused]
    for number in written:
        ledger.note(one, number)
    ledger.close([one])
    if not ledger.record():
        return
    found = account(ledger)
    missing = [n for reason in REASONS for low, high in found.get(reason, ()) for n in range(low, high + 1)]
    inside = {number for number in written if found["first"] <= number}
    assert len(missing) == len(set(missing))
    assert not inside & set(missing)
    assert inside | set(missing) == set(range(found["first"], found["last"] + 1))
