"""Sinks: what they do, and that no signal's handler runs inside them."""

from __future__ import annotations

from queue import SimpleQueue
from typing import Any

from metaros.sinks import Parcel, in_turn, parcel_to


def test_steps_run_in_turn_each_on_what_the_last_one_gave():
    assert in_turn(str, len)(1234) == 4
    assert in_turn(abs)(-1) == 1


def test_a_parcel_has_its_addressee():
    queue: SimpleQueue[Any] = SimpleQueue()
    send = parcel_to("box", queue.put)
    send(b"sample")
    send(None)
    parcels = [queue.get(), queue.get()]
    assert [type(parcel) for parcel in parcels] == [Parcel, Parcel]
    assert [(parcel.start, parcel.stop) for parcel in parcels] == [("box", b"sample"), ("box", None)]
