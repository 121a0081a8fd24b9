"""The checker finds what it is for: a campaign that cannot fail would prove nothing."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path

import pytest

from tests.support.robots.checker import Stored, StoredBatch, Verdict, check
from tests.support.robots.load_robot_samples import LOST, Counters, Entry, Journal, number_of, payload

EPOCH, BULK, METRIC = 7, 1, 0
KEY = (EPOCH, BULK)
Change = Callable[[Stored], None]


def honest() -> Stored:
    """Ten samples of one stream, of which 5 and 6 are declared lost, and three metric rows."""
    numbers = [number_of(0, count) for count in (1, 2, 3, 4, 7, 8, 9, 10)]
    data = [payload(0, number) for number in numbers]
    return Stored(
        batches=[StoredBatch(KEY, 1, data[:4]), StoredBatch(KEY, 7, data[4:])],
        gaps={KEY: [(5, 6, "disk_low")]},
        watermarks={KEY: 10, (EPOCH, METRIC): 3},
        metric_values=[float(number_of(0, count)) for count in (1, 2, 3)],
    )


def verdict_on(stored: Stored, folder: Path) -> Verdict:
    """What the checker says of it, given a robot that accepted these ten and three."""
    journal = Journal(folder / "journal")
    journal.write(
        [
            Entry(EPOCH, BULK, 1, number_of(0, 1), 4),
            Entry(EPOCH, BULK, 5, LOST, 2),
            Entry(EPOCH, BULK, 7, number_of(0, 7), 4),
            Entry(EPOCH, METRIC, 1, number_of(0, 1), 3),
        ]
    )
    journal.close()
    counters = Counters(folder / "counters", life=0)
    counters["bulk"], counters["metric"] = 10, 3
    counters.close()
    ranges = [
        {"stream_id": stream, "epoch": EPOCH, "first_seq": 1, "last_seq": last, "base_seq": 0}
        for stream, last in ((BULK, 10), (METRIC, 3))
    ]
    (folder / "final.json").write_text(json.dumps({"ranges": ranges}))
    return check(stored, folder, lives=1)


def test_an_honest_store_is_good(tmp_path: Path) -> None:
    verdict = verdict_on(honest(), tmp_path)

    assert (verdict.problems, verdict.accepted, verdict.rows, verdict.declared) == ([], 11, 11, 2)
    assert verdict.unaccepted == 0


def lose_a_batch(stored: Stored) -> None:
    del stored.batches[1]


def lose_one_inside(stored: Stored) -> None:
    stored.batches[0].payloads.pop()


def forget_the_gap(stored: Stored) -> None:
    stored.gaps.clear()


def lower_the_watermark(stored: Stored) -> None:
    stored.watermarks[KEY] = 9


def lose_a_metric(stored: Stored) -> None:
    stored.metric_values.pop()


@pytest.mark.parametrize("change", [lose_a_batch, lose_one_inside, forget_the_gap, lower_the_watermark, lose_a_metric])
def test_what_is_missing_is_lost(change: Change, tmp_path: Path) -> None:
    stored = honest()
    change(stored)

    assert verdict_on(stored, tmp_path).lost > 0


def store_twice(stored: Stored) -> None:
    stored.batches.append(StoredBatch((EPOCH, BULK | 1 << 31), 1, stored.batches[0].payloads[:1]))


def store_a_number_twice(stored: Stored) -> None:
    stored.batches.append(StoredBatch(KEY, 10, [payload(0, number_of(0, 11))]))


def store_a_metric_twice(stored: Stored) -> None:
    stored.metric_values[0] = stored.metric_values[1]


@pytest.mark.parametrize("change", [store_twice, store_a_number_twice, store_a_metric_twice])
def test_what_is_there_twice_is_a_duplicate(change: Change, tmp_path: Path) -> None:
    stored = honest()
    change(stored)

    assert verdict_on(stored, tmp_path).duplicate > 0


def flip_a_bit(stored: Stored) -> None:
    data = bytearray(stored.batches[0].payloads[2])
    data[-1] ^= 1
    stored.batches[0].payloads[2] = bytes(data)


def swap_two(stored: Stored) -> None:
    first = stored.batches[0].payloads
    first[0], first[1] = first[1], first[0]


def store_what_is_lost(stored: Stored) -> None:
    stored.batches.append(StoredBatch(KEY, 5, [payload(0, number_of(0, 5))]))


@pytest.mark.parametrize("change", [flip_a_bit, swap_two, store_what_is_lost])
def test_what_is_not_as_it_was_is_wrong(change: Change, tmp_path: Path) -> None:
    stored = honest()
    change(stored)

    assert verdict_on(stored, tmp_path).wrong > 0
