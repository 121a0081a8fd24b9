"""The camera's parameters, as text from the command line."""

from __future__ import annotations

import tomllib
from dataclasses import fields
from pathlib import Path

import pytest

import metaros.drivers.camera
from metaros.drivers.camera.parameters import CameraParameters, read_parameters
from metaros.errors import ConfigError


def test_defaults_are_those_of_the_manifest() -> None:
    folder = Path(metaros.drivers.camera.__path__[0])
    manifest = tomllib.loads((folder / "manifest.toml").read_text())
    listed = {item["name"]: item["default"] for item in manifest["parameters"]}
    assert {item.name for item in fields(CameraParameters)} == set(listed)
    assert read_parameters(listed) == read_parameters({}) == CameraParameters()


def test_numbers_are_read() -> None:
    parameters = read_parameters({"source": "test", "rate": "2.5", "width": "320", "height": "240", "quality": "90"})
    assert (parameters.rate, parameters.width, parameters.height, parameters.quality) == (2.5, 320, 240, 90)


@pytest.mark.parametrize(
    ("params", "words"),
    [
        ({"fps": "3"}, "no parameter 'fps'"),
        ({"rate": "fast"}, "rate must be a number"),
        ({"rate": "0"}, "rate must be 0.1 to 120"),
        ({"rate": "nan"}, "rate must be"),
        ({"width": "2.5"}, "width must be a number"),
        ({"quality": "101"}, "quality must be 1 to 100"),
        ({"width": "16000", "height": "16000"}, "at most 40000000"),
        ({"source": ""}, "source is empty"),
    ],
)
def test_mistakes_are_named(params: dict[str, str], words: str) -> None:
    with pytest.raises(ConfigError, match=words):
        read_parameters(params)
