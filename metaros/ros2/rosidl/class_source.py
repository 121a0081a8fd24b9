"""The generated methods and properties of a message class of rosidl's shape, as one would write them by hand."""

from __future__ import annotations

from array import array
from collections.abc import Callable
from functools import partial
from typing import Any

from metaros.idl.arrays import TYPE_CODES
from metaros.idl.catalogue import Catalogue
from metaros.idl.classes import message_class, zero
from metaros.idl.definitions import Field, FieldType
from metaros.ros2.rosidl.held import fixed_array, is_converted, is_numbers, listed, same, sequence, store, writable

__all__ = ["default_of", "methods"]


class _Missing:
    def __repr__(self) -> str:
        return "…"


_MISSING = _Missing()


def methods(
    fields: tuple[Field, ...],
    catalogue: Catalogue,
    *,
    name: str,
    check: bool,
    become_checked: Callable[[Any], None],
    rest: Callable[[Any, dict[str, Any]], None],
) -> tuple[dict[str, Any], dict[str, Any]]:
    """The constructor, equality and the properties of converted fields; and the scope that they look names up in.

    Equality needs the class in that scope as `_C`. `become_checked` is called where a check of values is asked for,
    by default with `check`; `rest` takes keywords that are no attributes of fields.
    """
    scope: dict[str, Any] = {
        "_missing": _MISSING,
        "_check": check,
        "_checked": become_checked,
        "_rest": rest,
        "_same": same,
        "_listed": listed,
        "_sequence": sequence,
        "_fixed": fixed_array,
        "_writable": writable,
    }
    lines = [*_constructor(fields, catalogue, scope), *_equality(fields)]
    for number, field in enumerate(fields):
        if is_converted(field.type):
            lines += _accessors(number, field, scope)
    exec(compile("\n".join(lines), f"<{name}>", "exec"), scope)
    members: dict[str, Any] = {"__init__": scope["__init__"], "__eq__": scope["__eq__"], "__hash__": None}
    for number, field in enumerate(fields):
        if is_converted(field.type):
            about = f"The field {field.name!r}."
            members[field.attribute] = property(scope[f"_get{number}"], scope[f"_set{number}"], None, about)
    return members, scope


def default_of(kind: FieldType, given: Any, catalogue: Catalogue) -> Callable[[], Any]:
    """A function that makes the value of a field that nobody sets; `given` is what the definition says, if not None."""
    count = kind.capacity if kind.array == "fixed" else 0
    if kind.is_nested:
        element = message_class(kind.base, catalogue)
        return (lambda: [element() for _ in range(count)]) if kind.array else element
    if not kind.array:
        value = _single_default(kind, given)
        return lambda: value
    if is_numbers(kind):
        if kind.array != "fixed":
            return partial(sequence, kind.base, () if given is None else given)
        return partial(fixed_array, kind.base, [0] * count if given is None else given)
    one = kind.element
    items = [_single_default(one, None)] * count if given is None else [_single_default(one, item) for item in given]
    return items.copy


def _single_default(kind: FieldType, given: Any) -> Any:
    if kind.base == "byte":
        return bytes((given or 0,))
    return zero(kind) if given is None else given


def _constructor(fields: tuple[Field, ...], catalogue: Catalogue, scope: dict[str, Any]) -> list[str]:
    parameters, body = ["*"], []
    if all(field.name != "check_fields" for field in fields):
        body.append("if check_fields: _checked(_self)")
        parameters.append("check_fields=_check")
    for number, field in enumerate(fields):
        name, kind, default = field.attribute, field.type, f"_d{number}"
        make = default_of(kind, field.default, catalogue)
        if not (kind.is_nested or kind.array):
            scope[default] = make()
            parameters.append(f"{name}={default}")
            body.append(f"_self.{name} = {name}")
            continue
        scope[default] = make
        parameters.append(f"{name}=_missing")
        if not is_converted(kind):
            body.append(f"_self.{name} = {default}() if {name} is _missing else {name}")
            continue
        given = name
        if is_numbers(kind):
            convert = "_fixed" if kind.array == "fixed" else "_sequence"
            given = f"{convert}({kind.base!r}, {name})"
        body.append(f"if {name} is _missing: _self.{store(field)} = {default}()")
        body.append(f"else: _self.{name} = {given}")
        if kind.array == "fixed" and is_numbers(kind):
            text = f"{field.name!r} takes {kind.capacity} numbers"
            body.append(f"if _self.{store(field)}.shape != ({kind.capacity},): raise AssertionError({text!r})")
    body.append("if _unknown: _rest(_self, _unknown)")
    if parameters == ["*"]:
        parameters = []
    return [
        f"def __init__(_self, {', '.join([*parameters, '**_unknown'])}):",
        *(f"    {line}" for line in body),
    ]


def _equality(fields: tuple[Field, ...]) -> list[str]:
    tests = ["True"]
    for field in fields:
        if is_numbers(field.type):
            tests.append(f"_same(_self.{store(field)}, _other.{store(field)})")
        else:
            tests.append(f"_self.{field.attribute} == _other.{field.attribute}")
    return [
        "def __eq__(_self, _other):",
        "    if _other is _self: return True",
        f"    return isinstance(_other, _C) and {' and '.join(tests)}",
    ]


def _accessors(number: int, field: Field, scope: dict[str, Any]) -> list[str]:
    """Reading converts what was received, once; setting converts what is set, as rosidl does."""
    kind, slot = field.type, f"_self.{store(field)}"
    lines = [f"def _get{number}(_self):", f"    value = {slot}"]
    if not is_numbers(kind):
        lines.append(f"    if value.__class__ is not list: value = {slot} = _listed({kind.base!r}, value)")
        lines += ["    return value", f"def _set{number}(_self, value):", f"    {slot} = value"]
        return lines
    if kind.array == "fixed":
        lines.append(f"    if not value.flags.writeable: value = {slot} = _writable(value)")
        lines += ["    return value", f"def _set{number}(_self, value):", f"    {slot} = _fixed({kind.base!r}, value)"]
        return lines
    scope["_array"], code = array, TYPE_CODES[kind.base]
    lines.append(f"    if value.__class__ is not _array: value = {slot} = _sequence({kind.base!r}, value)")
    lines += [
        "    return value",
        f"def _set{number}(_self, value):",
        f"    if value.__class__ is not _array or value.typecode != {code!r}: value = _sequence({kind.base!r}, value)",
        f"    {slot} = value",
    ]
    return lines
