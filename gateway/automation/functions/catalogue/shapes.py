"""What the AWS Lambda API takes and gives, by botocore's own service model: types, bounds, patterns, what is required.

The model's patterns know AWS's regions only. Ours is called `local`, so an ARN is compared as if it were of one of
theirs. Timestamps are numbers (seconds since the epoch); a zip file may be bytes or a path.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator, Mapping
from datetime import datetime
from functools import lru_cache
from pathlib import Path
from typing import Any

from botocore.loaders import Loader
from botocore.model import OperationModel, ServiceModel, Shape

from gateway.automation.functions.errors import FunctionInvalidError

__all__ = ["check_input", "faults_of", "model"]

MOST_FAULTS = 5
SHOWN_CHARS = 120
PATTERN_CHARS = 10_000  # no pattern is tried on longer text
_LOCAL = re.compile(r"^(arn:aws[a-zA-Z-]*:[a-z0-9-]+:)local:")


@lru_cache(maxsize=1)
def model() -> ServiceModel:
    """The newest model of the service that botocore has; read once, which takes some ten milliseconds."""
    return ServiceModel(Loader().load_service_model("lambda", "service-2"), "lambda")


def check_input(operation: str, asked: Mapping[str, Any]) -> None:
    """FunctionInvalidError for what the operation's model does not take; names every member that is wrong."""
    shape = _operation(operation).input_shape
    faults = list(faults_of(dict(asked), shape)) if shape is not None else [f"{name}: unknown" for name in asked]
    if faults:
        count = len(faults)
        shown = "; ".join(faults[:MOST_FAULTS])
        raise FunctionInvalidError(f"{count} validation error{'s' if count > 1 else ''} detected: {shown}")


def faults_of(value: Any, shape: Shape, where: str = "") -> Iterator[str]:
    """What is wrong about a value by its shape, each as `member: why`."""
    yield from _CHECKS[shape.type_name](value, shape, where)


@lru_cache(maxsize=128)
def _operation(name: str) -> OperationModel:
    return model().operation_model(name)


def _structure(value: Any, shape: Any, where: str) -> Iterator[str]:
    if not isinstance(value, dict):
        yield f"{where or 'the body'}: an object is wanted"
        return
    for name in shape.required_members:
        if value.get(name) is None:
            yield f"{_in(where, name)}: is required"
    for name, member in value.items():
        known = shape.members.get(name)
        if known is None:
            yield f"{_in(where, str(name)[:SHOWN_CHARS])}: is no member that this version knows"
        elif member is not None:
            yield from faults_of(member, known, _in(where, name))


def _list(value: Any, shape: Any, where: str) -> Iterator[str]:
    if not isinstance(value, list):
        yield f"{where}: a list is wanted"
        return
    yield from _bounds(len(value), shape, where, "items")
    for number, item in enumerate(value):
        yield from faults_of(item, shape.member, f"{where}[{number}]")


def _map(value: Any, shape: Any, where: str) -> Iterator[str]:
    if not isinstance(value, dict):
        yield f"{where}: an object is wanted"
        return
    yield from _bounds(len(value), shape, where, "entries")
    for key, item in value.items():
        yield from faults_of(key, shape.key, f"{where} (a key)")
        yield from faults_of(item, shape.value, _in(where, str(key)[:SHOWN_CHARS]))


def _string(value: Any, shape: Any, where: str) -> Iterator[str]:
    if not isinstance(value, str):
        yield f"{where}: text is wanted"
        return
    shown = "" if shape.metadata.get("sensitive") else f" {value[:SHOWN_CHARS]!r}"
    yield from _bounds(len(value), shape, where, "characters")
    if shape.enum and value not in shape.enum:
        yield f"{where}:{shown} is none of {', '.join(shape.enum)}"
    pattern = shape.metadata.get("pattern")
    if pattern is not None and value and not _fits(pattern, value):
        yield f"{where}:{shown} does not fit {pattern}"


def _fits(pattern: str, value: str) -> bool:
    return len(value) <= PATTERN_CHARS and _compiled(pattern).fullmatch(_LOCAL.sub(r"\1us-east-1:", value)) is not None


@lru_cache(maxsize=512)
def _compiled(pattern: str) -> re.Pattern[str]:
    """Java's classes of letters, numbers and blanks are Python's, as far as names of tags go."""
    return re.compile(pattern.replace(r"\p{L}", r"\w").replace(r"\p{N}", r"\d").replace(r"\p{Z}", r"\s"))


def _integer(value: Any, shape: Any, where: str) -> Iterator[str]:
    if not isinstance(value, int) or isinstance(value, bool) or abs(value) >= 1 << 63:
        yield f"{where}: a whole number is wanted"
    else:
        yield from _bounds(value, shape, where, "")


def _double(value: Any, shape: Any, where: str) -> Iterator[str]:
    if not isinstance(value, int | float) or isinstance(value, bool) or value != value:
        yield f"{where}: a number is wanted"
    else:
        yield from _bounds(value, shape, where, "")


def _boolean(value: Any, _shape: Any, where: str) -> Iterator[str]:
    if not isinstance(value, bool):
        yield f"{where}: true or false is wanted"


def _blob(value: Any, _shape: Any, where: str) -> Iterator[str]:
    if not isinstance(value, bytes | bytearray | Path):
        yield f"{where}: bytes are wanted, base64 in JSON"


def _timestamp(value: Any, _shape: Any, where: str) -> Iterator[str]:
    if not isinstance(value, int | float | datetime) or isinstance(value, bool) or value != value:
        yield f"{where}: seconds since 1970 are wanted"


def _bounds(amount: float, shape: Any, where: str, what: str) -> Iterator[str]:
    least, most = shape.metadata.get("min"), shape.metadata.get("max")
    if least is not None and amount < least:
        yield f"{where}: {amount} {what} is under {least}".replace("  ", " ")
    if most is not None and amount > most:
        yield f"{where}: {amount} {what} is over {most}".replace("  ", " ")


def _in(where: str, name: str) -> str:
    return f"{where}.{name}" if where else name


_CHECKS: dict[str, Callable[[Any, Any, str], Iterator[str]]] = {
    "structure": _structure,
    "list": _list,
    "map": _map,
    "string": _string,
    "integer": _integer,
    "long": _integer,
    "double": _double,
    "float": _double,
    "boolean": _boolean,
    "blob": _blob,
    "timestamp": _timestamp,
}
