"""`rosidl_parser.definition`: what a field's type is, as programs read it from `SLOT_TYPES`.

The types of fields alone: parsed files, structures and annotations are in `metaros.idl`.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, Final

__all__ = [
    "ACTION_FEEDBACK_MESSAGE_SUFFIX",
    "ACTION_FEEDBACK_SUFFIX",
    "ACTION_GOAL_SERVICE_SUFFIX",
    "ACTION_GOAL_SUFFIX",
    "ACTION_RESULT_SERVICE_SUFFIX",
    "ACTION_RESULT_SUFFIX",
    "BASIC_TYPES",
    "BOOLEAN_TYPE",
    "CHARACTER_TYPES",
    "EMPTY_STRUCTURE_REQUIRED_MEMBER_NAME",
    "FLOATING_POINT_TYPES",
    "INTEGER_TYPES",
    "OCTET_TYPE",
    "SERVICE_EVENT_MESSAGE_SUFFIX",
    "SERVICE_REQUEST_MESSAGE_SUFFIX",
    "SERVICE_RESPONSE_MESSAGE_SUFFIX",
    "SIGNED_EXPLICIT_INTEGER_TYPES",
    "SIGNED_INTEGER_TYPES",
    "SIGNED_NONEXPLICIT_INTEGER_TYPES",
    "UNSIGNED_EXPLICIT_INTEGER_TYPES",
    "UNSIGNED_INTEGER_TYPES",
    "UNSIGNED_NONEXPLICIT_INTEGER_TYPES",
    "AbstractGenericString",
    "AbstractNestableType",
    "AbstractNestedType",
    "AbstractSequence",
    "AbstractString",
    "AbstractType",
    "AbstractWString",
    "Array",
    "BasicType",
    "BoundedSequence",
    "BoundedString",
    "BoundedWString",
    "NamedType",
    "NamespacedType",
    "UnboundedSequence",
    "UnboundedString",
    "UnboundedWString",
]

SIGNED_NONEXPLICIT_INTEGER_TYPES: Final = ("short", "long", "long long")
UNSIGNED_NONEXPLICIT_INTEGER_TYPES: Final = tuple(f"unsigned {name}" for name in SIGNED_NONEXPLICIT_INTEGER_TYPES)
SIGNED_EXPLICIT_INTEGER_TYPES: Final = ("int8", "int16", "int32", "int64")
UNSIGNED_EXPLICIT_INTEGER_TYPES: Final = tuple(f"u{name}" for name in SIGNED_EXPLICIT_INTEGER_TYPES)
SIGNED_INTEGER_TYPES: Final = (*SIGNED_NONEXPLICIT_INTEGER_TYPES, *SIGNED_EXPLICIT_INTEGER_TYPES)
UNSIGNED_INTEGER_TYPES: Final = (*UNSIGNED_NONEXPLICIT_INTEGER_TYPES, *UNSIGNED_EXPLICIT_INTEGER_TYPES)
INTEGER_TYPES: Final = (*SIGNED_INTEGER_TYPES, *UNSIGNED_INTEGER_TYPES)
FLOATING_POINT_TYPES: Final = ("float", "double", "long double")
CHARACTER_TYPES: Final = ("char", "wchar")
BOOLEAN_TYPE: Final = "boolean"
OCTET_TYPE: Final = "octet"
BASIC_TYPES: Final = (*INTEGER_TYPES, *FLOATING_POINT_TYPES, *CHARACTER_TYPES, BOOLEAN_TYPE, OCTET_TYPE)

EMPTY_STRUCTURE_REQUIRED_MEMBER_NAME: Final = "structure_needs_at_least_one_member"
SERVICE_REQUEST_MESSAGE_SUFFIX: Final = "_Request"
SERVICE_RESPONSE_MESSAGE_SUFFIX: Final = "_Response"
SERVICE_EVENT_MESSAGE_SUFFIX: Final = "_Event"
ACTION_GOAL_SUFFIX: Final = "_Goal"
ACTION_RESULT_SUFFIX: Final = "_Result"
ACTION_FEEDBACK_SUFFIX: Final = "_Feedback"
ACTION_GOAL_SERVICE_SUFFIX: Final = "_SendGoal"
ACTION_RESULT_SERVICE_SUFFIX: Final = "_GetResult"
ACTION_FEEDBACK_MESSAGE_SUFFIX: Final = "_FeedbackMessage"


class AbstractType:
    """The base of all types; two of one class with the same values are equal."""

    __slots__ = ()

    def _values(self) -> tuple[Any, ...]:
        return ()

    def __eq__(self, other: object) -> bool:
        return type(other) is type(self) and other._values() == self._values()

    def __hash__(self) -> int:
        return hash((type(self).__name__, *map(str, self._values())))

    def __repr__(self) -> str:
        return f"{type(self).__name__}({', '.join(map(repr, self._values()))})"


class AbstractNestableType(AbstractType):
    """A type that arrays and sequences can be made of."""

    __slots__ = ()


class BasicType(AbstractNestableType):
    """A number, a boolean or an octet; `typename` is IDL's word: "double", "uint8", "boolean"."""

    __slots__ = ("typename",)

    def __init__(self, typename: str) -> None:
        if typename not in BASIC_TYPES:
            raise AssertionError(f"{typename!r} is no basic type of IDL, such as 'double' or 'uint8'")
        self.typename = typename

    def _values(self) -> tuple[Any, ...]:
        return (self.typename,)


class NamedType(AbstractNestableType):
    """A type known by a name without namespaces."""

    __slots__ = ("name",)

    def __init__(self, name: str) -> None:
        self.name = name

    def _values(self) -> tuple[Any, ...]:
        return (self.name,)


class NamespacedType(AbstractNestableType):
    """Another message: `namespaces` is like ["std_msgs", "msg"], `name` like "String"."""

    __slots__ = ("name", "namespaces")

    def __init__(self, namespaces: Sequence[str], name: str) -> None:
        self.namespaces = namespaces
        self.name = name

    def namespaced_name(self) -> tuple[str, ...]:
        """Namespaces and name: ("std_msgs", "msg", "String")."""
        return (*self.namespaces, self.name)

    def _values(self) -> tuple[Any, ...]:
        return (list(self.namespaces), self.name)


class AbstractGenericString(AbstractNestableType):
    """A text of any kind."""

    __slots__ = ()

    def has_maximum_size(self) -> bool:
        """Whether it has a bound, which is `maximum_size` then."""
        return False


class AbstractString(AbstractGenericString):
    """A text of 8-bit characters: on the wire UTF-8."""

    __slots__ = ()


class BoundedString(AbstractString):
    """A `string<=N`."""

    __slots__ = ("maximum_size",)

    def __init__(self, maximum_size: int) -> None:
        self.maximum_size = maximum_size

    def has_maximum_size(self) -> bool:
        """Yes."""
        return True

    def _values(self) -> tuple[Any, ...]:
        return (self.maximum_size,)


class UnboundedString(AbstractString):
    """A `string`."""

    __slots__ = ()


class AbstractWString(AbstractGenericString):
    """A text of wide characters."""

    __slots__ = ()


class BoundedWString(AbstractWString):
    """A `wstring<=N`."""

    __slots__ = ("maximum_size",)

    def __init__(self, maximum_size: int) -> None:
        self.maximum_size = maximum_size

    def has_maximum_size(self) -> bool:
        """Yes."""
        return True

    def _values(self) -> tuple[Any, ...]:
        return (self.maximum_size,)


class UnboundedWString(AbstractWString):
    """A `wstring`."""

    __slots__ = ()


class AbstractNestedType(AbstractType):
    """Many of one type, which is `value_type`."""

    __slots__ = ("value_type",)

    def __init__(self, value_type: AbstractNestableType) -> None:
        self.value_type = value_type

    def has_maximum_size(self) -> bool:
        """Whether the number of elements has a bound."""
        return False

    def _values(self) -> tuple[Any, ...]:
        return (self.value_type,)


class Array(AbstractNestedType):
    """`T[size]`."""

    __slots__ = ("size",)

    def __init__(self, value_type: AbstractNestableType, size: int) -> None:
        super().__init__(value_type)
        self.size = size

    def has_maximum_size(self) -> bool:
        """Yes: it has always as many."""
        return True

    def _values(self) -> tuple[Any, ...]:
        return (self.value_type, self.size)


class AbstractSequence(AbstractNestedType):
    """Any number of elements, perhaps up to a bound."""

    __slots__ = ()


class BoundedSequence(AbstractSequence):
    """`T[<=maximum_size]`."""

    __slots__ = ("maximum_size",)

    def __init__(self, value_type: AbstractNestableType, maximum_size: int) -> None:
        super().__init__(value_type)
        self.maximum_size = maximum_size

    def has_maximum_size(self) -> bool:
        """Yes."""
        return True

    def _values(self) -> tuple[Any, ...]:
        return (self.value_type, self.maximum_size)


class UnboundedSequence(AbstractSequence):
    """`T[]`."""

    __slots__ = ()
