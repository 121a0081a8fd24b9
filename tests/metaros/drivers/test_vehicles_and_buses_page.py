"""The files that docs/howto/vehicles_and_buses.md shows can be used as they are, and its parameters exist."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

from metaros.drivers.can.signals import Signals
from metaros.drivers.modbus.points import read_map
from metaros.drivers.registry import manifest_of
from metaros.drivers.values import read_values

PAGE = (Path(__file__).parents[3] / "docs/howto/vehicles_and_buses.md").read_text(encoding="utf-8")


def block(language: str, tmp_path: Path) -> str:
    (text,) = re.findall(rf"^```{language}\n(.*?)^```", PAGE, re.MULTILINE | re.DOTALL)
    file = tmp_path / f"page.{language}"
    file.write_text(text)
    return str(file)


def test_the_dbc(tmp_path: Path) -> None:
    signals = Signals(block("dbc", tmp_path), "Motor/*")
    assert dict(signals.values(256, extended=False, data=bytes([10, 0, 1, *[0] * 5]))) == {
        "Motor/Speed": pytest.approx(1.0),
        "Motor/Hot": 1.0,
    }


def test_the_map(tmp_path: Path) -> None:
    points = {point.name: point for point in read_map(block("toml", tmp_path))}
    assert points["temperature"].value((215,)) == pytest.approx(21.5)
    assert points["energy"].value((2, 1)) == 65538
    assert (points["fan"].writable, points["fan"].safe, points["fan"].watchdog_s) == (True, 0, 0.3)


def test_the_commands() -> None:
    commands = re.findall(r"^metaros driver run (\w+) (.*)$", PAGE, re.MULTILINE)
    assert {kind for kind, _ in commands} == {"mavlink", "can", "modbus"}
    for kind, rest in commands:
        given = dict(re.findall(r"--param '?(\w+)=([^' ]+)", rest))
        assert read_values(manifest_of(kind), given).keys() == given.keys()


@pytest.mark.parametrize(
    ("kind", "name"),
    [
        ("mavlink", "allow_arm"),
        ("mavlink", "allow_mode"),
        ("mavlink", "allow_velocity"),
        ("can", "allow_tx"),
        ("can", "tx_ids"),
        ("modbus", "map"),
    ],
)
def test_what_allows_is_off_and_nobody_s_afar(kind: str, name: str) -> None:
    parameter = manifest_of(kind).parameter(name)
    assert parameter.local
    assert not parameter.default
