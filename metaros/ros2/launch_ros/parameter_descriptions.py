"""Parameters whose texts are known when the launch runs."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from metaros.ros2.launch.substitution import SomeSubstitutionsType, Substitution, perform_substitutions

__all__ = ["Parameter", "ParameterFile", "ParameterValue", "evaluate", "flattened"]


class ParameterValue:
    """A value of a certain type: a substitution's text is read as that, and not as YAML would guess."""

    def __init__(self, value: Any, *, value_type: Any = None) -> None:
        self.value, self.value_type = value, value_type

    def evaluate(self, context: Any) -> Any:
        """The value."""
        return evaluate(context, self.value, self.value_type)


class Parameter(ParameterValue):
    """A value with its name."""

    def __init__(self, name: SomeSubstitutionsType, value: Any, *, value_type: Any = None) -> None:
        super().__init__(value, value_type=value_type)
        self.name = name


class ParameterFile:
    """A parameter file; with `allow_substs` substitutions in its text, such as $(env HOME) and $(var name), count."""

    def __init__(
        self, param_file: SomeSubstitutionsType, *, allow_substs: bool | SomeSubstitutionsType = False
    ) -> None:
        self.param_file, self.allow_substs = param_file, allow_substs

    def evaluate(self, context: Any, folder: Path) -> Path:
        """The file to be read; one in `folder` where its text had to be changed."""
        path = Path(perform_substitutions(context, self.param_file))
        allowed = self.allow_substs
        if not isinstance(allowed, bool):
            allowed = perform_substitutions(context, allowed).lower() == "true"
        if not allowed:
            return path
        made = folder / f"{path.stem}_{len(list(folder.iterdir()))}.yaml"
        made.write_text(_substituted(context, path.read_text(encoding="utf-8")), encoding="utf-8")
        return made


def evaluate(context: Any, value: Any, value_type: Any = None) -> Any:
    """The value that a node gets: texts of substitutions are read as YAML, unless a type is asked for."""
    if isinstance(value, ParameterValue):
        return value.evaluate(context)
    if isinstance(value, Substitution) or _is_composed(value):
        return _typed(perform_substitutions(context, value), value_type)
    if isinstance(value, (list, tuple)):
        return [evaluate(context, item) for item in value]
    if value_type is not None and isinstance(value, str):
        return _typed(value, value_type)
    return value


def flattened(context: Any, parameters: Mapping[Any, Any], prefix: str = "") -> dict[str, Any]:
    """`{"a": {"b": 1}}` is `{"a.b": 1}`; names and values may be substitutions."""
    found: dict[str, Any] = {}
    for key, value in parameters.items():
        name = prefix + perform_substitutions(context, key)
        if isinstance(value, Mapping):
            found |= flattened(context, value, f"{name}.")
        else:
            found[name] = evaluate(context, value)
    return found


def _is_composed(value: Any) -> bool:
    """Several parts of one text: at least one is a substitution, the others are texts."""
    if not isinstance(value, (list, tuple)) or not any(isinstance(item, Substitution) for item in value):
        return False
    return all(isinstance(item, (str, Substitution)) for item in value)


def _typed(text: str, value_type: Any) -> Any:
    if value_type is str:
        return text
    import yaml

    found = yaml.safe_load(text) if text.strip() else text
    if value_type in (int, float, bool) and not isinstance(found, (int, float)):
        raise ValueError(f"{text!r} is no {value_type.__name__}")
    if value_type in (int, float, bool):
        return value_type(found)
    return found if isinstance(found, (bool, int, float, str)) or _is_list(found) else text


def _is_list(found: Any) -> bool:
    return isinstance(found, Sequence) and all(isinstance(item, (bool, int, float, str)) for item in found)


def _substituted(context: Any, text: str) -> str:
    import re

    def one(match: re.Match[str]) -> str:
        kind, name = match[1], match[2].strip()
        found = context.launch_configurations if kind == "var" else context.environment
        if name not in found:
            raise ValueError(f"$({kind} {name}) is not known here")
        return str(found[name])

    return re.sub(r"\$\((var|env)\s+([^)]+)\)", one, text)
