"""Rates: a loop on its own thread, woken by a timer on the executor."""

from __future__ import annotations

import threading
from typing import Any

import pytest

from metaros.ros2.rclpy.core.context import Context
from metaros.ros2.rclpy.names.exceptions import ROSInterruptException
from metaros.ros2.rclpy.time.rate import Rate
from tests.support.waiting import wait_until


class FakeTimer:
    """A timer that the test calls."""

    callback: Any = None
    canceled = False

    def is_canceled(self) -> bool:
        """As set."""
        return self.canceled


@pytest.fixture
def context() -> Context:
    """Initialised; nothing in it needs a session."""
    context = Context()
    context.init([])
    return context


def _sleep_ends_by(rate: Rate, end: Any) -> BaseException | None:
    """What a sleep on another thread raises once `end()` has ended it."""
    raised: list[BaseException] = []

    def sleep() -> None:
        try:
            rate.sleep()
        except Exception as error:
            raised.append(error)

    threads = [threading.Thread(target=sleep, daemon=True) for _ in range(2)]
    for thread in threads:
        thread.start()
    wait_until(lambda: len(rate._sleepers) == 2)
    end()
    for thread in threads:
        thread.join(5)
        assert not thread.is_alive()
    return raised[0] if raised else None


def test_a_call_of_the_timer_ends_every_sleep(context: Context) -> None:
    timer = FakeTimer()
    rate = Rate(timer, context=context)
    assert _sleep_ends_by(rate, timer.callback) is None
    timer.callback()  # nobody slept: the next sleep ends at once, and only that
    rate.sleep()
    assert _sleep_ends_by(rate, timer.callback) is None


def test_what_else_ends_a_sleep(context: Context) -> None:
    timer = FakeTimer()
    rate = Rate(timer, context=context)
    assert _sleep_ends_by(rate, rate.destroy) is None
    with pytest.raises(RuntimeError, match="destroyed"):
        rate.sleep()
    rate = Rate(timer, context=context)
    timer.canceled = True
    with pytest.raises(RuntimeError, match="canceled"):
        rate.sleep()
    timer.canceled = False
    assert isinstance(_sleep_ends_by(rate, context.shutdown), ROSInterruptException)
    with pytest.raises(ROSInterruptException):
        rate.sleep()
