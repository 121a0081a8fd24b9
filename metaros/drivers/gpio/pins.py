"""Which pins are what: the texts of the parameters, read and checked. Pure."""

from __future__ import annotations

import math
import re
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

from metaros.errors import ConfigError

__all__ = ["InputPin", "OutputPin", "parse_inputs", "parse_outputs", "refuse_doubles"]

MAX_PINS: Final = 64
MAX_PULSE_S: Final = 3600.0
_NAME: Final = re.compile(r"[a-z][a-z0-9_]{0,62}")
_PIN: Final = re.compile(r"[A-Za-z0-9_]{1,16}")
_PULLS: Final = {"pull_up": True, "pull_down": False, "floating": None}


@dataclass(frozen=True, slots=True, kw_only=True)
class InputPin:
    """`pull_up` as gpiozero has it: None is floating. With a pull-up the input is on while its pin is low."""

    pin: str
    name: str
    pull_up: bool | None = False
    inverted: bool = False


@dataclass(frozen=True, slots=True, kw_only=True)
class OutputPin:
    """`safe`: its state at start, at the end, and while nobody refreshes a watched one. `pulse_s`: 0 is none."""

    pin: str
    name: str
    safe: bool = False
    active_low: bool = False
    watched: bool = False
    pulse_s: float = 0.0


def parse_inputs(text: str) -> list[InputPin]:
    """`pin:name[:pull_up|pull_down|floating][:inverted]`, separated by commas. ConfigError quotes what is wrong."""
    pins = []
    for pin, name, options in _entries(text):
        pulls = [option for option in options if option in _PULLS]
        if unknown := set(options) - set(_PULLS) - {"inverted"}:
            raise ConfigError(f"input {name}: unknown option {', '.join(sorted(unknown))}")
        if len(pulls) > 1:
            raise ConfigError(f"input {name}: {' and '.join(pulls)} exclude each other")
        pull_up = _PULLS[pulls[0]] if pulls else False
        pins.append(InputPin(pin=pin, name=name, pull_up=pull_up, inverted="inverted" in options))
    return pins


def parse_outputs(text: str) -> list[OutputPin]:
    """`pin:name[:off|on][:low][:watchdog][:pulse=seconds]`, separated by commas."""
    pins = []
    for pin, name, options in _entries(text):
        pulses = [option for option in options if option.startswith("pulse=")]
        if unknown := set(options) - {"off", "on", "low", "watchdog", *pulses}:
            raise ConfigError(f"output {name}: unknown option {', '.join(sorted(unknown))}")
        if {"off", "on"} <= set(options) or len(pulses) > 1:
            raise ConfigError(f"output {name}: options exclude each other: {', '.join(options)}")
        pins.append(
            OutputPin(
                pin=pin,
                name=name,
                safe="on" in options,
                active_low="low" in options,
                watched="watchdog" in options,
                pulse_s=_pulse_s(name, pulses[0]) if pulses else 0.0,
            )
        )
    return pins


def refuse_doubles(inputs: Sequence[InputPin], outputs: Sequence[OutputPin]) -> None:
    """Raise ConfigError where a pin or a name is there twice, or nothing is there at all."""
    both: list[InputPin | OutputPin] = [*inputs, *outputs]
    if not both:
        raise ConfigError("gpio: no pins; set `inputs` or `outputs`, such as 17:door")
    for what, values in (("pin", [pin.pin for pin in both]), ("name", [pin.name for pin in both])):
        if double := next((value for value in values if values.count(value) > 1), ""):
            raise ConfigError(f"gpio: {what} {double} is there twice")


def _entries(text: str) -> list[tuple[str, str, list[str]]]:
    entries = []
    for entry in filter(None, (part.strip() for part in text.split(","))):
        pin, _, rest = entry.partition(":")
        name, *options = rest.split(":")
        if not _PIN.fullmatch(pin) or not _NAME.fullmatch(name):
            raise ConfigError(f"gpio: {entry!r} is not like 17:door; names are a-z, 0-9 and _")
        entries.append((pin, name, options))
    if len(entries) > MAX_PINS:
        raise ConfigError(f"gpio: more than {MAX_PINS} pins")
    return entries


def _pulse_s(name: str, option: str) -> float:
    try:
        pulse_s = float(option.removeprefix("pulse="))
    except ValueError:
        pulse_s = math.nan
    if not 0 < pulse_s <= MAX_PULSE_S:
        raise ConfigError(f"output {name}: {option}: a pulse is of 0 to {MAX_PULSE_S:g} s")
    return pulse_s
