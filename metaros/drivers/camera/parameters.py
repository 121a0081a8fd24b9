"""The camera's parameters, read from text."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, fields

from metaros.errors import ConfigError

__all__ = ["MAX_PIXELS", "CameraParameters", "read_parameters"]

MAX_PIXELS = 40_000_000


@dataclass(frozen=True, slots=True, kw_only=True)
class CameraParameters:
    """What manifest.toml lists."""

    source: str = "0"
    rate: float = 10.0
    width: int = 640
    height: int = 360
    quality: int = 70
    topic: str = "camera/image/compressed"
    frame_id: str = "camera"


NUMBERS: Mapping[str, tuple[Callable[[str], float], float, float]] = {
    "rate": (float, 0.1, 120),
    "width": (int, 16, 16384),
    "height": (int, 16, 16384),
    "quality": (int, 1, 100),
}


def read_parameters(params: Mapping[str, str]) -> CameraParameters:
    """The parameters of `--param NAME=VALUE` options.

    Raises:
        ConfigError: an unknown name, or a value out of range.
    """
    known = {item.name for item in fields(CameraParameters)}
    values: dict[str, object] = {}
    for name, text in params.items():
        if name not in known:
            raise ConfigError(f"camera: no parameter {name!r}; there are {', '.join(sorted(known))}")
        values[name] = number(name, text) if name in NUMBERS else text
    parameters = CameraParameters(**values)  # type: ignore[arg-type]
    if parameters.width * parameters.height > MAX_PIXELS:
        raise ConfigError(f"camera: width x height is {parameters.width * parameters.height}, at most {MAX_PIXELS}")
    if not parameters.source:
        raise ConfigError("camera: source is empty; give a device number, a file, an address or `test`")
    return parameters


def number(name: str, text: str) -> float:
    """A number within its range."""
    convert, low, high = NUMBERS[name]
    try:
        value = convert(text)
    except ValueError as error:
        raise ConfigError(f"camera: {name} must be a number, not {text!r}") from error
    if not low <= value <= high:
        raise ConfigError(f"camera: {name} must be {low:g} to {high:g}, not {text}")
    return value
