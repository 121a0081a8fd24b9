"""Interface names as people type them: `std_msgs/String` is `std_msgs/msg/String`, and a typo gets a hint."""

from __future__ import annotations

from typing import Any

from metaros.errors import FieldError, UnknownTypeError, UsageError

__all__ = ["full_type", "parse_values"]


def full_type(name: str, kind: str = "msg") -> str:
    """The full name of an interface in the catalogue; UnknownTypeError with near matches otherwise."""
    from metaros.cli.shared.connection import closest
    from metaros.idl import default_catalogue

    catalogue = default_catalogue()
    parts = name.split("/")
    full = f"{parts[0]}/{kind}/{parts[1]}" if len(parts) == 2 else name
    if full in catalogue:
        return full
    hint = closest(full, catalogue.names(kind)) or f"`metaros interface list` shows all {len(catalogue.names())}"
    raise UnknownTypeError(f"no interface {full!r} in the catalogue\n{hint}")


def parse_values(text: str, type_name: str) -> dict[str, Any]:
    """YAML (JSON is YAML too) as a dictionary of fields; what is left out keeps its default."""
    import yaml

    try:
        value = yaml.safe_load(text) if text.strip() else {}
    except yaml.YAMLError as error:
        problem = str(error).splitlines()[0]
        raise UsageError(f"the values are no YAML: {problem}\nexample: {example(type_name)!r}") from None
    if not isinstance(value, dict):
        raise FieldError(f"the values of a {type_name} are fields, not {text!r}\nexample: {example(type_name)!r}")
    return value


def example(type_name: str) -> str:
    """Values for the first fields of a message, as one could type them."""
    from metaros.idl import default_catalogue

    samples = {"bool": "true", "string": "text", "wstring": "text", "float32": "0.5", "float64": "0.5"}
    definition = default_catalogue().get(type_name)
    fields = getattr(definition, "fields", ())[:2]
    parts = []
    for field in fields:
        sample = "{}" if field.type.is_nested else samples.get(field.type.base, "1")
        parts.append(f"{field.name}: {f'[{sample}]' if field.type.array else sample}")
    return f"{{{', '.join(parts)}}}"
