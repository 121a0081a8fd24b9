"""Messages as text: YAML in the look of `ros2 topic echo`, and the value of one field path."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

from metaros.errors import FieldError

__all__ = ["field_of", "message_yaml", "plain"]

ARRAY_ITEMS = 16  # longer ones are cut, unless asked for in full


def message_yaml(message: Any, *, full: bool = False) -> str:
    """One message as YAML; arrays longer than 16 are cut unless `full`."""
    return "\n".join(_lines(message, "", full))


def plain(message: Any) -> Any:
    """A message or field value for JSON."""
    from metaros.idl.json import to_json

    return to_json(message) if _is_message(message) else _plain(message)


def field_of(message: Any, path: str) -> Any:
    """The value at `a.b[2].c`; FieldError names the part that does not exist and what there is."""
    value = message
    for name in path.replace("[", ".[").split("."):
        if name.startswith("[") and name.endswith("]") and name[1:-1].isdigit():
            value = _element(value, int(name[1:-1]), path)
            continue
        known = _attributes(value)
        if name not in known:
            raise FieldError(f"no field {name!r} in {path!r}: there is {', '.join(known) or 'no field'}")
        value = getattr(value, known[name])
    return value


def _element(value: Any, index: int, path: str) -> Any:
    if not hasattr(value, "__len__") or isinstance(value, str):
        raise FieldError(f"{path!r}: not an array")
    if index >= len(value):
        raise FieldError(f"{path!r}: the array has {len(value)} elements")
    return value[index]


def _is_message(value: Any) -> bool:
    return hasattr(type(value), "__metaros_name__")


def _attributes(value: Any) -> dict[str, str]:
    """Field names and the attributes that hold them (`from` is held in `from_`); none for what is no message."""
    return {field.name: field.attribute for field in getattr(type(value), "__metaros_fields__", ())}


def _lines(message: Any, indent: str, full: bool) -> Iterator[str]:
    for name, attribute in _attributes(message).items():
        yield from _field(name, getattr(message, attribute), indent, full)


def _field(name: str, value: Any, indent: str, full: bool) -> Iterator[str]:
    if _is_message(value):
        yield f"{indent}{name}:"
        yield from _lines(value, indent + "  ", full)
    elif not isinstance(value, str) and hasattr(value, "__len__"):
        yield from _array(name, value, indent, full)
    else:
        yield f"{indent}{name}: {_scalar(value)}"


def _array(name: str, value: Any, indent: str, full: bool) -> Iterator[str]:
    shown = value if full or len(value) <= ARRAY_ITEMS else value[:ARRAY_ITEMS]
    if len(value) and _is_message(value[0]):
        yield f"{indent}{name}:"
        for item in shown:
            first, *rest = list(_lines(item, indent + "  ", full)) or [f"{indent}  {{}}"]
            yield f"{indent}- {first.lstrip()}"
            yield from rest
        if len(shown) < len(value):
            yield f"{indent}# and {len(value) - len(shown)} more"
        return
    items = ", ".join(_scalar(item) for item in _plain(shown))
    cut = f"  # and {len(value) - len(shown)} more" if len(shown) < len(value) else ""
    yield f"{indent}{name}: [{items}]{cut}"


def _plain(value: Any) -> Any:
    """Numpy to Python; a list of messages element by element."""
    if isinstance(value, (bytes, bytearray, memoryview)):
        return list(value)
    if hasattr(value, "tolist"):
        return value.tolist()
    return [plain(item) for item in value] if isinstance(value, (list, tuple)) else value


def _scalar(value: Any) -> str:
    if isinstance(value, bool):
        return "true" if value else "false"
    if isinstance(value, float):
        return _number(value)
    if isinstance(value, str):
        return _text(value)
    return str(value.item() if hasattr(value, "item") else value)


def _number(value: float) -> str:
    if value != value:
        return ".nan"
    return repr(value) if abs(value) != float("inf") else (".inf" if value > 0 else "-.inf")


def _text(value: str) -> str:
    """A string so that YAML reads it back: quoted where it could be taken for something else."""
    import yaml

    return str(yaml.safe_dump(value, width=2**31, allow_unicode=True).removesuffix("\n...\n").rstrip("\n"))
