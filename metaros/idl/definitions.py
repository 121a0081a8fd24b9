"""What an interface is made of: frozen tables that the parser fills and every other module reads."""

from __future__ import annotations

from dataclasses import dataclass
from keyword import iskeyword
from typing import TypeAlias

__all__ = [
    "INTEGER_RANGES",
    "PRIMITIVES",
    "ActionDefinition",
    "Constant",
    "Definition",
    "Field",
    "FieldType",
    "MessageDefinition",
    "ServiceDefinition",
    "Value",
]

Value: TypeAlias = "bool | int | float | str | list[bool] | list[int] | list[float] | list[str]"

INTEGER_RANGES: dict[str, tuple[int, int]] = {
    "byte": (0, 255),
    "char": (0, 255),
    "int8": (-(2**7), 2**7 - 1),
    "uint8": (0, 2**8 - 1),
    "int16": (-(2**15), 2**15 - 1),
    "uint16": (0, 2**16 - 1),
    "int32": (-(2**31), 2**31 - 1),
    "uint32": (0, 2**32 - 1),
    "int64": (-(2**63), 2**63 - 1),
    "uint64": (0, 2**64 - 1),
}

PRIMITIVES = frozenset({"bool", "float32", "float64", "string", "wstring", *INTEGER_RANGES})


@dataclass(frozen=True, slots=True)
class FieldType:
    """The type of a field: a primitive or a full interface name, perhaps in an array or a sequence of it.

    `array` is "" for one value, "fixed" for `T[n]`, "bounded" for `T[<=n]` and "unbounded" for `T[]`;
    `capacity` is that n, else 0. `string_bound` is the n of `string<=n`, else 0.
    """

    base: str
    array: str = ""
    capacity: int = 0
    string_bound: int = 0

    @property
    def is_nested(self) -> bool:
        """Whether the base is another interface rather than a primitive."""
        return self.base not in PRIMITIVES

    @property
    def is_string(self) -> bool:
        """Whether the base is text."""
        return self.base in ("string", "wstring")

    @property
    def is_sequence(self) -> bool:
        """Whether the number of elements is on the wire."""
        return self.array in ("bounded", "unbounded")

    @property
    def element(self) -> FieldType:
        """The same type without its array."""
        return FieldType(self.base, string_bound=self.string_bound)

    def text(self, *, slots: bool = False) -> str:
        """As written in a .msg file, or with `slots` as rclpy's `get_fields_and_field_types()` spells it."""
        base = self.base
        if self.is_nested:
            package, kind, name = base.split("/")
            base = f"{package}/{name}" if kind == "msg" else base
        elif slots:
            base = _SLOT_NAMES.get(base, base)
        if self.string_bound:
            base += f"<{self.string_bound}>" if slots else f"<={self.string_bound}"
        if self.array == "fixed":
            return f"{base}[{self.capacity}]"
        if self.array == "bounded":
            return f"sequence<{base}, {self.capacity}>" if slots else f"{base}[<={self.capacity}]"
        if self.array == "unbounded":
            return f"sequence<{base}>" if slots else f"{base}[]"
        return base


_SLOT_NAMES = {"bool": "boolean", "byte": "octet", "char": "uint8", "float32": "float", "float64": "double"}


@dataclass(frozen=True, slots=True)
class Field:
    """One field; `default` is None when the definition gives none (zero, empty text, empty sequence)."""

    name: str
    type: FieldType
    default: Value | None = None

    @property
    def attribute(self) -> str:
        """The Python attribute of the field: its name, with `_` behind it where Python reserves the word."""
        return f"{self.name}_" if iskeyword(self.name) else self.name


@dataclass(frozen=True, slots=True)
class Constant:
    """A named value of an interface; it is not on the wire."""

    name: str
    type: FieldType
    value: bool | int | float | str


@dataclass(frozen=True, slots=True)
class MessageDefinition:
    """A message, or one half of a service or action; `name` is like "std_msgs/msg/String"."""

    name: str
    fields: tuple[Field, ...] = ()
    constants: tuple[Constant, ...] = ()


@dataclass(frozen=True, slots=True)
class ServiceDefinition:
    """A service: its halves are named `<name>_Request` and `<name>_Response`."""

    name: str
    request: MessageDefinition
    response: MessageDefinition


@dataclass(frozen=True, slots=True)
class ActionDefinition:
    """An action: its parts are named `<name>_Goal`, `<name>_Result` and `<name>_Feedback`."""

    name: str
    goal: MessageDefinition
    result: MessageDefinition
    feedback: MessageDefinition


Definition: TypeAlias = "MessageDefinition | ServiceDefinition | ActionDefinition"
