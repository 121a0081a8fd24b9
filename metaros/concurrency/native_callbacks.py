"""Native callbacks that Zenoh may call on any thread: functions without a line of Python in them.

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

__all__ = ["Addressed", "addressed_to", "chain"]

Addressed = slice  # `start` is the addressee, `stop` what it gets: the one pair that C makes of two arguments


def chain(*steps: Callable[[Any], Any]) -> Callable[[Any], Any]:
    """`value -> last(… first(value))`, as one C function where the steps are; the value must not know `|`."""
    return partial(reduce, operator.or_, tuple(_as_operand(step) for step in steps))


def addressed_to(addressee: object, put: Callable[[Addressed], object]) -> Callable[[Any], Any]:
    """`item -> put(Addressed(addressee, item))`, as one C function where `put` is."""
    return chain(partial(Addressed, addressee), put)


def _as_operand(step: Callable[[Any], Any]) -> Any:
    """Something for which `value | it` is `step(value)`."""
    return type("Step", (), {"__slots__": (), "__ror__": staticmethod(step)})()
