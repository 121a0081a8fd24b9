"""Read .msg, .srv and .action text. What is wrong is a `DefinitionError` that names the interface and the line."""

from __future__ import annotations

import math
import re
from collections.abc import Iterator

from metaros.errors import DefinitionError
from metaros.idl.definitions import (
    INTEGER_RANGES,
    PRIMITIVES,
    ActionDefinition,
    Constant,
    Field,
    FieldType,
    MessageDefinition,
    ServiceDefinition,
    Value,
)
from metaros.idl.literals import parse_list, parse_scalar, unquoted_comment_start

__all__ = ["MAX_TEXT_CHARS", "parse_action", "parse_msg", "parse_srv"]

MAX_TEXT_CHARS = 1_000_000
MAX_CAPACITY = 2**31 - 1
MAX_FIXED = 2**24

_NAME = re.compile(r"([a-z][a-z0-9_]*)/(msg|srv|action)/([A-Za-z][A-Za-z0-9_]*)\Z")
_TYPE = re.compile(
    r"(?P<base>[A-Za-z][A-Za-z0-9_]*(?:/[A-Za-z0-9_]+){0,2})"
    r"(?:<=(?P<bound>[0-9]{1,20}))?"
    r"(?P<array>\[(?P<limit><=)?(?P<size>[0-9]{0,20})\])?\Z"
)
_LINE = re.compile(r"(?P<type>\S+)\s+(?P<name>[^\s=]+)\s*(?P<rest>.*)\Z", re.DOTALL)
_FIELD_NAME = re.compile(r"[a-z][a-z0-9]*(?:_[a-z0-9]+)*\Z")  # every part has one way to match: no long search
_CONSTANT_NAME = re.compile(r"[A-Z][A-Z0-9]*(?:_[A-Z0-9]+)*\Z")
_TYPE_NAME = re.compile(r"[A-Z][A-Za-z0-9]*(?:_[A-Za-z0-9]+)*\Z")
_ALIASES = {"time": "builtin_interfaces/msg/Time", "duration": "builtin_interfaces/msg/Duration"}


def parse_msg(text: str, name: str) -> MessageDefinition:
    """The message that `text` defines under the full name `name`, like "std_msgs/msg/String"."""
    (part,) = _parts(text, name, kind="msg", suffixes=("",))
    return part


def parse_srv(text: str, name: str) -> ServiceDefinition:
    """The service of a .srv text: request and response with `---` between them."""
    request, response = _parts(text, name, kind="srv", suffixes=("_Request", "_Response"))
    return ServiceDefinition(name, request, response)


def parse_action(text: str, name: str) -> ActionDefinition:
    """The action of an .action text: goal, result and feedback with `---` between them."""
    goal, result, feedback = _parts(text, name, kind="action", suffixes=("_Goal", "_Result", "_Feedback"))
    return ActionDefinition(name, goal, result, feedback)


def _parts(text: str, name: str, *, kind: str, suffixes: tuple[str, ...]) -> list[MessageDefinition]:
    match = _NAME.match(name)
    if not match or (match[2] != kind and kind != "msg"):
        raise DefinitionError(f"{name!r} is no name of a {kind}: it must look like package/{kind}/Name")
    if len(text) > MAX_TEXT_CHARS:
        raise DefinitionError(
            f"{name}: the definition has {len(text)} characters, at most {MAX_TEXT_CHARS} are allowed"
        )
    parts: list[list[tuple[int, str]]] = [[]]
    for number, line in enumerate(text.splitlines(), start=1):
        if line.strip() == "---":
            parts.append([])
            if len(parts) > len(suffixes):
                raise DefinitionError(f"{name}, line {number}: one `---` too many for a .{kind} file")
        else:
            parts[-1].append((number, line))
    if len(parts) != len(suffixes):
        raise DefinitionError(f"{name}: a .{kind} file has {len(suffixes)} parts separated by `---`, not {len(parts)}")
    return [_message(lines, name + suffix, package=match[1]) for lines, suffix in zip(parts, suffixes, strict=True)]


def _message(lines: list[tuple[int, str]], name: str, *, package: str) -> MessageDefinition:
    fields: list[Field] = []
    constants: list[Constant] = []
    seen: set[str] = set()
    for number, statement in _statements(lines):
        try:
            entry = _entry(statement, package)
        except DefinitionError as error:
            raise DefinitionError(f"{name}, line {number}: {error}") from None
        if entry.name in seen:
            raise DefinitionError(f"{name}, line {number}: {entry.name!r} is defined twice")
        seen.add(entry.name)
        if isinstance(entry, Constant):
            constants.append(entry)
        else:
            fields.append(entry)
    return MessageDefinition(name, tuple(fields), tuple(constants))


def _statements(lines: list[tuple[int, str]]) -> Iterator[tuple[int, str]]:
    for number, line in lines:
        statement = line[: unquoted_comment_start(line)].strip()
        if statement and statement != "@optional":
            yield number, statement


def _entry(statement: str, package: str) -> Field | Constant:
    match = _LINE.match(statement)
    if not match:
        raise DefinitionError(f"expected `type name`, found {statement[:80]!r}")
    type_text, name, rest = match["type"], match["name"], match["rest"]
    if rest.startswith("=") and not type_text.endswith("="):
        return _constant(type_text, name, rest[1:].strip(), package)
    field_type = _field_type(type_text, package)
    if not _FIELD_NAME.match(name):
        raise DefinitionError(f"{name!r} is no field name: lower case letters, digits and single underscores")
    return Field(name, field_type, _default(field_type, rest) if rest else None)


def _constant(type_text: str, name: str, value: str, package: str) -> Constant:
    field_type = _field_type(type_text, package)
    if field_type.is_nested or field_type.array:
        raise DefinitionError(f"the constant {name!r} must be of a primitive type, not {type_text!r}")
    if not _CONSTANT_NAME.match(name):
        raise DefinitionError(f"{name!r} is no constant name: upper case letters, digits and single underscores")
    parsed = parse_scalar(field_type.base, value)
    _check_value(field_type, parsed)
    return Constant(name, field_type, parsed)


def _field_type(text: str, package: str) -> FieldType:
    match = _TYPE.match(text)
    if not match:
        raise DefinitionError(f"{text!r} is no type")
    base = _base(match["base"], package)
    bound = int(match["bound"]) if match["bound"] else 0
    if match["bound"] and (base not in ("string", "wstring") or not 0 < bound <= MAX_CAPACITY):
        raise DefinitionError(f"{text!r}: only a string can have an upper bound, and it is at least 1")
    if match["array"] is None:
        return FieldType(base, string_bound=bound)
    if not match["size"]:
        if match["limit"]:
            raise DefinitionError(f"{text!r}: the bound of the sequence is missing")
        return FieldType(base, "unbounded", 0, bound)
    size = int(match["size"])
    largest = MAX_CAPACITY if match["limit"] else MAX_FIXED
    if not 0 < size <= largest:
        raise DefinitionError(f"{text!r}: the size must be between 1 and {largest}")
    return FieldType(base, "bounded" if match["limit"] else "fixed", size, bound)


def _base(text: str, package: str) -> str:
    if text in PRIMITIVES:
        return text
    if text in _ALIASES:
        return _ALIASES[text]
    parts = text.split("/")
    if len(parts) == 1:
        parts = [package, "msg", text]
    elif len(parts) == 2:
        parts.insert(1, "msg")
    full = "/".join(parts)
    if not _NAME.match(full) or not _TYPE_NAME.match(parts[2]):
        raise DefinitionError(f"{text!r} is neither a primitive type nor the name of a message")
    return full


def _default(field_type: FieldType, text: str) -> Value:
    if field_type.is_nested:
        raise DefinitionError("a field of a message type cannot have a default value")
    if not field_type.array:
        value = parse_scalar(field_type.base, text)
        _check_value(field_type, value)
        return value
    values = parse_list(field_type.base, text)
    if field_type.array == "fixed" and len(values) != field_type.capacity:
        raise DefinitionError(f"the default has {len(values)} elements, the array has {field_type.capacity}")
    if field_type.array == "bounded" and len(values) > field_type.capacity:
        raise DefinitionError(f"the default has {len(values)} elements, at most {field_type.capacity} are allowed")
    for value in values:
        _check_value(field_type, value)
    return values  # type: ignore[return-value]


def _check_value(field_type: FieldType, value: bool | int | float | str) -> None:
    if field_type.base in INTEGER_RANGES:
        low, high = INTEGER_RANGES[field_type.base]
        if not low <= int(value) <= high:
            raise DefinitionError(f"{value} does not fit {field_type.base} ({low} to {high})")
    elif field_type.base == "float32" and isinstance(value, float):
        if math.isfinite(value) and abs(value) > 3.4028235677973366e38:
            raise DefinitionError(f"{value} does not fit float32")
    elif field_type.string_bound and isinstance(value, str) and len(value) > field_type.string_bound:
        raise DefinitionError(
            f"the default text has {len(value)} characters, at most {field_type.string_bound} are allowed"
        )
