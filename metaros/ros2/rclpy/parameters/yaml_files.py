"""What YAML says: parameter files as `ros2 param dump` writes them, and values as people type them."""

from __future__ import annotations

import re
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import Any

from metaros.errors import ConfigError
from metaros.ros2.rclpy.parameters.conversion import message_of
from metaros.ros2.rclpy.parameters.value import Parameter

__all__ = ["get_parameter_value", "parameter_dict_from_yaml_file"]


def get_parameter_value(string_value: str) -> Any:
    """What a person typed, as a rcl_interfaces/msg/ParameterValue of the type that YAML gives it, else a text."""
    import yaml

    types = Parameter.Type
    try:
        value = yaml.safe_load(string_value)
        kind = types.BOOL_ARRAY if value == [] else types.from_parameter_value(value)  # so rclpy has it
    except (yaml.YAMLError, ValueError, TypeError, RecursionError):
        kind = types.NOT_SET
    if kind in (types.NOT_SET, types.BYTE_ARRAY):
        kind, value = types.STRING, string_value
    return Parameter("", kind, value).get_parameter_value()


def parameter_dict_from_yaml_file(
    parameter_file: str,
    use_wildcard: bool = False,
    target_nodes: Sequence[str] | None = None,
    namespace: str = "",
) -> dict[str, Any]:
    """What the file has for the `target_nodes`, for all without them: rcl_interfaces/msg/Parameter by name.

    `use_wildcard` takes in what it says of `/**` and the like; what names a node wins over it. `namespace` goes
    before each name. OSError where the file cannot be read, RuntimeError where it is no parameter file, or says
    nothing of the nodes.
    """
    from metaros.node.parameters.files import read_sections

    text = Path(parameter_file).read_text(encoding="utf-8")
    try:
        sections = read_sections(text, str(parameter_file))
    except ConfigError as error:
        raise RuntimeError(f"invalid structure of the parameter file, `ros2 param dump` shows it: {error}") from None
    wanted = [(name, values) for name, values in sections if _wanted(name, target_nodes or (), use_wildcard)]
    if not wanted:
        raise RuntimeError(
            f"Param file does not contain any valid parameters: {parameter_file} has none"
            f"{_for(target_nodes)}; it names {', '.join(name for name, _ in sections) or 'no node'}"
        )
    wanted.sort(key=lambda section: "*" not in section[0])  # as they are in the file, wildcards first
    values = {f"{namespace}{name}": value for _, given in wanted for name, value in given.items()}
    return {name: message_of(name, value) for name, value in values.items()}


def _wanted(name: str, targets: Iterable[str], use_wildcard: bool) -> bool:
    if "*" in name and not use_wildcard:
        return False
    pattern = _pattern(name)
    return not targets or any(pattern.fullmatch(f"/{target.lstrip('/')}") for target in targets)


def _pattern(name: str) -> re.Pattern[str]:
    """`/*` stands for one part of a name, `/**` for one or more of them, as in rclpy."""
    parts = (
        "(?:/[^/]+)+" if part == "**" else "/" + "[^/]+".join(map(re.escape, part.split("*")))
        for part in name.split("/")[1:]
    )
    return re.compile("".join(parts))


def _for(targets: Sequence[str] | None) -> str:
    return f" for {', '.join(targets)}" if targets else ""
