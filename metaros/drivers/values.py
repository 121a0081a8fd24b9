"""A driver's parameters: from text or typed values to what its manifest allows, and on the node."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

from metaros.drivers.manifest import Manifest, Parameter
from metaros.errors import ConfigError

if TYPE_CHECKING:
    from metaros.node import Node

__all__ = ["declare", "read_value", "read_values"]

_FLAGS = {"true": True, "yes": True, "on": True, "1": True, "false": False, "no": False, "off": False, "0": False}


def read_values(manifest: Manifest, given: Mapping[str, Any]) -> dict[str, Any]:
    """The given values, texts converted, all checked. ConfigError: an unknown name, a value that does not fit."""
    return {name: read_value(manifest, manifest.parameter(name), value) for name, value in given.items()}


def read_value(manifest: Manifest, parameter: Parameter, value: Any) -> Any:
    """One value in its parameter's type and range; ConfigError names both."""
    where = f"{manifest.kind}: {parameter.name}"
    converted = _converted(where, parameter, value)
    low = -math.inf if parameter.minimum is None else parameter.minimum
    high = math.inf if parameter.maximum is None else parameter.maximum
    number = isinstance(converted, int | float) and not isinstance(converted, bool)
    if number and not (math.isfinite(converted) and low <= converted <= high):
        raise ConfigError(f"{where} must be {low:g} to {high:g}, not {value}")
    if parameter.choices and converted not in parameter.choices:
        raise ConfigError(f"{where} must be one of {', '.join(map(str, parameter.choices))}, not {value!r}")
    if isinstance(converted, str) and ("\0" in converted or len(converted) > 4096):
        raise ConfigError(f"{where} has a NUL, or more than 4096 characters")
    return converted


def _converted(where: str, parameter: Parameter, value: Any) -> Any:
    kind = parameter.python_type
    if kind is float and type(value) is int:
        return float(value)
    if type(value) is kind:
        return value
    if not isinstance(value, str):
        raise ConfigError(f"{where} must be a {parameter.type}, not {value!r}")
    if kind is bool:
        if value.lower() not in _FLAGS:
            raise ConfigError(f"{where} must be true or false, not {value!r}")
        return _FLAGS[value.lower()]
    try:
        return kind(value)
    except ValueError:
        raise ConfigError(f"{where} must be a {'whole number' if kind is int else 'number'}, not {value!r}") from None


def declare(node: Node, manifest: Manifest) -> None:
    """Declare all parameters on the node. What is `local` is read-only on the wire: a remote set is refused."""
    for parameter in manifest.parameters:
        rules: dict[str, Any] = {"description": parameter.summary, "read_only": parameter.local}
        if parameter.type in ("integer", "number"):
            rules |= {"minimum": parameter.minimum, "maximum": parameter.maximum}
        if parameter.choices:
            rules["choices"] = parameter.choices
        node.declare_parameter(parameter.name, parameter.python_type(parameter.default), **rules)
