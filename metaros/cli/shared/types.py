"""Interface names as people type them: `std_msgs/String` is `std_msgs/msg/String`, and a typo gets a hint."""

from __future__ import annotations

from collections.abc import Collection
from typing import TYPE_CHECKING, Any

from metaros.errors import FieldError, UnknownTypeError, UsageError

if TYPE_CHECKING:
    from metaros.idl import Catalogue

__all__ = ["expand", "full_type", "parse_values", "type_in_use"]


def expand(name: str, kind: str = "msg") -> str:
    """`std_msgs/String` in full; whether there is such a type is not asked: a peer's need not be in the catalogue."""
    parts = name.split("/")
    return f"{parts[0]}/{kind}/{parts[1]}" if len(parts) == 2 else name


def type_in_use(what: str, typed: str, kind: str, types: Collection[str]) -> str:
    """The one of the `types` of a service or an action that is meant; UsageError where the typed one is none of them.

    UnknownTypeError, with near matches, where that is no type at all.
    """
    wanted = expand(typed, kind) if typed else sorted(types)[0]
    if wanted in types:
        return wanted
    fact = f"{what} is a {' or '.join(sorted(types))}"
    try:
        wanted = full_type(typed, kind)
    except UnknownTypeError as error:
        raise UnknownTypeError(f"{error}\n{fact}") from None
    raise UsageError(f"{fact}, not a {wanted}")


def full_type(name: str, kind: str = "msg") -> str:
    """The full name of an interface in the catalogue; UnknownTypeError with near matches otherwise."""
    from metaros.cli.shared.connection import closest
    from metaros.idl import default_catalogue

    catalogue = default_catalogue()
    full = expand(name, kind)
    if full in catalogue:
        return full
    if trouble := catalogue.trouble(full):
        raise UnknownTypeError(f"no interface {full!r} in the catalogue: {trouble}")
    hint = closest(full, catalogue.names(kind)) or f"`metaros interface list` shows all {len(catalogue.names())}"
    raise UnknownTypeError(f"no interface {full!r} in the catalogue\n{hint}")


def parse_values(text: str, type_name: str, catalogue: Catalogue | None = None) -> dict[str, Any]:
    """YAML (JSON is YAML too) as a dictionary of fields; what is left out keeps its default."""
    import yaml

    try:
        value = yaml.safe_load(text) if text.strip() else {}
    except yaml.YAMLError as error:
        problem = str(error).splitlines()[0]
        raise UsageError(f"the values are no YAML: {problem}\nexample: {example(type_name, catalogue)!r}") from None
    if not isinstance(value, dict):
        raise FieldError(
            f"the values of a {type_name} are fields, not {text!r}\nexample: {example(type_name, catalogue)!r}"
        )
    return value


def example(type_name: str, catalogue: Catalogue | None = None) -> str:
    """Values for the first fields of a message, as one could type them."""
    from metaros.idl import default_catalogue

    samples = {"bool": "true", "string": "text", "wstring": "text", "float32": "0.5", "float64": "0.5"}
    definition = (catalogue or default_catalogue()).get(type_name)
    fields = getattr(definition, "fields", ())[:2]
    parts = []
    for field in fields:
        sample = "{}" if field.type.is_nested else samples.get(field.type.base, "1")
        parts.append(f"{field.name}: {f'[{sample}]' if field.type.array else sample}")
    return f"{{{', '.join(parts)}}}"
