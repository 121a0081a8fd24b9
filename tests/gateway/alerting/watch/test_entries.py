"""Records of the log: what is packed is what comes back, bit by bit."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from gateway.alerting.watch.entries import Cycle, pack_cycle, pack_rows, unpack_cycle, unpack_rows
from tests.gateway.alerting.watch.made import entry


def test_rows_come_back_with_every_bit() -> None:
    made = entry(5, 4, robot="räuber", epoch=2**64 - 1, series=("a.x", "b.y"))
    made = replace(made, values=np.array([math.nan, math.inf, -0.0, 5e-324]))
    back = unpack_rows(pack_rows(made))
    assert (back.mark, back.first_seq, back.seq, back.series) == (made.mark, 5, 8, made.series)
    assert back.values.tobytes() == made.values.tobytes()
    assert back.stamps.tolist() == made.stamps.tolist()
    assert back.index.tolist() == made.index.tolist()


def test_a_span_is_what_lies_between_two_marks() -> None:
    made = entry(11, 10)
    assert [
        made.values[made.span(after, up_to)].tolist() for after, up_to in ((10, 12), (0, 11), (19, 99), (20, 20))
    ] == [
        [11, 12],
        [11],
        [20],
        [],
    ]


def test_a_cycle_comes_back() -> None:
    cycle = Cycle(now_s=1.1, marks={("r1", 1 << 31, 2**64 - 1): 2**53 + 1}, facts=[["heard", ["r1"], 0.1]])
    assert unpack_cycle(pack_cycle(cycle)) == cycle
