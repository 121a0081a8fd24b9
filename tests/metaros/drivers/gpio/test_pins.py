"""The texts that say which pins are what."""

from __future__ import annotations

import contextlib

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from metaros.drivers.gpio.pins import InputPin, OutputPin, parse_inputs, parse_outputs, refuse_doubles
from metaros.errors import ConfigError


def test_inputs_with_their_options() -> None:
    assert parse_inputs("17:door, 27:bumper:pull_up,BOARD11:lid:floating:inverted,") == [
        InputPin(pin="17", name="door"),
        InputPin(pin="27", name="bumper", pull_up=True),
        InputPin(pin="BOARD11", name="lid", pull_up=None, inverted=True),
    ]
    assert parse_inputs("") == []


def test_outputs_with_their_options() -> None:
    assert parse_outputs("22:lamp:off,23:pump:off:watchdog,24:horn:pulse=0.5,25:brake:on:low") == [
        OutputPin(pin="22", name="lamp"),
        OutputPin(pin="23", name="pump", watched=True),
        OutputPin(pin="24", name="horn", pulse_s=0.5),
        OutputPin(pin="25", name="brake", safe=True, active_low=True),
    ]


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ("17", "not like 17:door"),
        (":door", "not like 17:door"),
        ("17:Door", "a-z"),
        ("17:a/b", "a-z"),
        ("17:door:pull", "unknown option pull"),
        ("17:door:pull_up:floating", "exclude each other"),
        (",".join(f"{at}:p{at}" for at in range(65)), "more than 64"),
    ],
)
def test_wrong_inputs_are_refused(text: str, says: str) -> None:
    with pytest.raises(ConfigError, match=says):
        parse_inputs(text)


@pytest.mark.parametrize(
    "option", ["maybe", "off:on", "pulse=x", "pulse=0", "pulse=nan", "pulse=9e9", "pulse=1:pulse=2"]
)
def test_wrong_outputs_are_refused(option: str) -> None:
    with pytest.raises(ConfigError, match="lamp"):
        parse_outputs(f"22:lamp:{option}")


@pytest.mark.parametrize(
    ("inputs", "outputs", "says"),
    [("", "", "no pins"), ("17:a", "17:b", "pin 17"), ("17:a", "18:a", "name a")],
)
def test_doubles_and_nothing_are_refused(inputs: str, outputs: str, says: str) -> None:
    with pytest.raises(ConfigError, match=says):
        refuse_doubles(parse_inputs(inputs), parse_outputs(outputs))


@settings(deadline=None)
@given(st.text(max_size=60))
def test_any_text_is_pins_or_a_clear_refusal(text: str) -> None:
    for parse in (parse_inputs, parse_outputs):
        with contextlib.suppress(ConfigError):
            assert all(pin.name and pin.pin for pin in parse(text))
