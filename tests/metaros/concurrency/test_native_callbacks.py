"""Sinks: what they do, and that no signal's handler runs inside them."""

from __future__ import annotations

from queue import SimpleQueue
from typing import Any

from metaros.concurrency.native_callbacks import Addressed, addressed_to, chain


def test_steps_run_in_turn_each_on_what_the_last_one_gave():
    assert chain(str, len)(1234) == 4
    assert chain(abs)(-1) == 1


def test_a_parcel_has_its_addressee():
    queue: SimpleQueue[Any] = SimpleQueue()
    send = addressed_to("box", queue.put)
    send(b"sample")
    send(None)
    parcels = [queue.get(), queue.get()]
    assert [type(parcel) for parcel in parcels] == [Addressed, Addressed]
    assert [(parcel.start, parcel.stop) for parcel in parcels] == [("box", b"sample"), ("box", None)]
