"""The kernel's records, and the state that they make."""

from __future__ import annotations

import struct
from collections import Counter
from random import Random  # noqa: TID251 - seeded

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from metaros.drivers.joystick.events import DROPPED, EV_ABS, EV_KEY, EV_SYN, RECORD, REPORT, EventReader, InputEvent
from metaros.drivers.joystick.layout import STANDARD, AxisRange, Layout, PadState
from tests.support.devices.gamepad_emulator import TL, record


def events_of(data: bytes, counts: Counter[str] | None = None, *, chunk: int = 4096) -> list[InputEvent]:
    counts = Counter() if counts is None else counts
    reader = EventReader(lambda name, by: counts.update({name: by}))
    return [event for at in range(0, len(data), chunk) for event in reader.feed(data[at : at + chunk])]


@pytest.mark.parametrize("chunk", [1, 7, 4096])
def test_records_come_whole_or_in_pieces(chunk: int) -> None:
    stream = record(EV_ABS, 0, -32768) + record(EV_KEY, TL, 1) + record(EV_SYN, REPORT, 0)
    assert events_of(stream, chunk=chunk) == [
        InputEvent(EV_ABS, 0, -32768),
        InputEvent(EV_KEY, TL, 1),
        InputEvent(EV_SYN, REPORT, 0),
    ]


@pytest.mark.skipif(struct.calcsize("P") != 8, reason="of machines with 64 bits")
def test_a_record_is_what_the_kernel_writes() -> None:
    written = bytes.fromhex("00f1536500000000 40e2010000000000 0300 0100 0080ffff".replace(" ", ""))
    assert events_of(written) == [InputEvent(EV_ABS, 1, -32768)]


def test_noise_is_counted_and_records_after_it_are_found() -> None:
    counts: Counter[str] = Counter()
    noise = Random(4).randbytes(1_000_000)
    found = events_of(noise + b"\xff" * RECORD.size + record(EV_KEY, TL, 1), counts)
    assert found[-1] == InputEvent(EV_KEY, TL, 1)
    assert counts["skipped_bytes"] > 900_000


@settings(deadline=None)
@given(st.lists(st.one_of(st.binary(max_size=40), st.just(record(EV_KEY, TL, 1)))))
def test_whatever_comes_the_state_is_within_its_bounds(pieces: list[bytes]) -> None:
    state = PadState(STANDARD)
    for event in events_of(b"".join(pieces), chunk=11):
        state.take(event)
    assert all(-1 <= value <= 1 for value in state.axes(0.1))
    assert set(state.buttons()) <= {0, 1}


@pytest.mark.parametrize(
    ("low", "high", "value", "scaled"),
    [(-100, 100, -100, 1), (-100, 100, 100, -1), (-100, 100, 4, 0), (0, 255, 255, -1), (0, 0, 5, 0), (-1, 1, 9, -1)],
)
def test_left_and_up_are_positive_and_the_middle_is_zero(low: int, high: int, value: int, scaled: float) -> None:
    assert AxisRange(low, high).scaled(value, 0.1) == scaled


def test_beyond_the_deadzone_an_axis_begins_at_zero() -> None:
    assert AxisRange(-1000, 1000).scaled(-100, 0.1) == pytest.approx(0)
    assert AxisRange(-1000, 1000).scaled(-550, 0.1) == pytest.approx(0.5)


def pressed(*events: InputEvent) -> tuple[list[bool], PadState]:
    state = PadState(STANDARD)
    return [state.take(event) for event in events], state


def test_a_group_is_reported_at_its_end() -> None:
    reported, state = pressed(InputEvent(EV_ABS, 1, -32768), InputEvent(EV_KEY, TL, 1), InputEvent(EV_SYN, REPORT, 0))
    assert reported == [False, False, True]
    assert state.axes(0.1)[1] == 1.0
    assert state.buttons()[4] == 1


def test_repetition_is_no_press() -> None:
    _, state = pressed(InputEvent(EV_KEY, TL, 2))
    assert state.buttons()[4] == 0


def test_after_dropped_events_nothing_is_pressed_until_it_is_pressed_anew() -> None:
    reported, state = pressed(
        InputEvent(EV_KEY, TL, 1),
        InputEvent(EV_ABS, 1, -32768),
        InputEvent(EV_SYN, DROPPED, 0),
        InputEvent(EV_KEY, TL, 1),
        InputEvent(EV_SYN, REPORT, 0),
    )
    assert reported == [False, False, True, False, False]
    assert sum(state.buttons()) == 0
    assert state.axes(0.1)[1] == 0.0
    state.take(InputEvent(EV_KEY, TL, 1))
    assert state.buttons()[4] == 1


def test_the_range_and_place_that_the_kernel_tells_are_taken() -> None:
    state = PadState(Layout("wheel", {0: AxisRange(0, 1000, 250)}, (0x120,)))
    assert state.axes(0.0) == [0.5]
    assert not state.take(InputEvent(EV_ABS, 7, 5))
    assert state.buttons() == [0]
