"""What Zenoh may call on any thread: functions without a line of Python in them.

Zenoh calls back on the caller's thread, too: what is published to a subscription of the same session, a query that a
service of the same session answers. There, on the main thread, Python runs the handlers of signals as soon as Python
code begins, and what they raise ends in Zenoh, which prints it and goes on: Ctrl-C would be lost, and the sample with
it. C functions are never interrupted so: the signal waits until Zenoh has returned.
"""

from __future__ import annotations

import operator
from collections.abc import Callable
from functools import partial, reduce
from typing import Any

__all__ = ["Parcel", "in_turn", "parcel_to"]

Parcel = slice  # `start` is the addressee, `stop` what it gets: the one pair that C makes of two arguments


def in_turn(*steps: Callable[[Any], Any]) -> Callable[[Any], Any]:
    """`value -> last(… first(value))`, as one C function where the steps are; the value must not know `|`."""
    return partial(reduce, operator.or_, tuple(_as_operand(step) for step in steps))


def parcel_to(addressee: object, put: Callable[[Parcel], object]) -> Callable[[Any], Any]:
    """`item -> put(Parcel(addressee, item))`, as one C function where `put` is."""
    return in_turn(partial(Parcel, addressee), put)


def _as_operand(step: Callable[[Any], Any]) -> Any:
    """Something for which `value | it` is `step(value)`."""
    return type("Step", (), {"__slots__": (), "__ror__": staticmethod(step)})()
