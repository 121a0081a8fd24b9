"""Debouncing, pulses and the outputs' watchdog."""

from __future__ import annotations

from metaros.drivers.gpio.pins import OutputPin
from metaros.drivers.gpio.states import Debounced, OutputState


def test_a_bouncing_input_changes_once_it_rests() -> None:
    state = Debounced()
    assert state.look(False, 0.0, debounce_s=0.02)
    reported = [state.look(seen, now_s, debounce_s=0.02) for now_s, seen in ((1.0, True), (1.01, False), (1.02, True))]
    assert reported == [False] * 3
    assert not state.look(True, 1.03, debounce_s=0.02)
    assert state.look(True, 1.041, debounce_s=0.02)
    assert state.value is True
    assert not state.look(True, 1.05, debounce_s=0.02)


def test_without_debouncing_each_change_is_reported() -> None:
    state = Debounced()
    assert [state.look(seen, 0.0, debounce_s=0.0) for seen in (True, False, True, True)] == [True, True, True, False]


def test_an_output_stays_as_it_was_set() -> None:
    state = OutputState(OutputPin(pin="22", name="lamp"), watchdog_s=0.3)
    assert state.value(0.0) is False
    state.set(True, 0.0)
    assert state.value(1e6) is True
    state.rest()
    assert state.value(1e6) is False


def test_a_watched_output_is_safe_without_refreshing() -> None:
    state = OutputState(OutputPin(pin="23", name="pump", watched=True), watchdog_s=0.3)
    state.set(True, 0.0)
    state.set(True, 0.2)
    assert state.value(0.49) is True
    assert state.value(0.5) is False
    assert state.value(0.6) is False
    state.set(True, 0.7)
    state.set(False, 0.8)
    assert state.value(0.8) is False


def test_a_pulse_ends_by_itself_and_is_not_prolonged() -> None:
    state = OutputState(OutputPin(pin="24", name="horn", pulse_s=0.5), watchdog_s=0.3)
    state.set(True, 0.0)
    state.set(True, 0.4)
    assert state.value(0.45) is True
    assert state.value(0.5) is False
    state.set(True, 0.6)
    assert state.value(1.0) is True
    assert state.value(1.1) is False


def test_the_safe_state_may_be_on() -> None:
    state = OutputState(OutputPin(pin="25", name="brake", safe=True, watched=True), watchdog_s=0.3)
    state.set(False, 0.0)
    assert state.value(0.1) is False
    assert state.value(0.4) is True
