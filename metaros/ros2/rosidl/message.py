"""What all message classes of rosidl's shape have: their repr, copies, pickles, and the checks one may ask for."""

from __future__ import annotations

import copy
from array import array
from typing import Any, ClassVar

from metaros.idl.classes import Message, message_class
from metaros.ros2.rosidl.held import store

__all__ = ["RosidlMessage", "become_checked", "refill", "set_rest"]


class RosidlMessage(Message):
    """The base of the message classes that ROS 2 programs know."""

    __slots__ = ()
    _check_fields: ClassVar[bool] = False
    _fields_and_field_types: ClassVar[dict[str, str]]
    SLOT_TYPES: ClassVar[tuple[Any, ...]]

    @classmethod
    def get_fields_and_field_types(cls) -> dict[str, str]:
        """The fields' types in words, by name: a new dict."""
        return dict(cls._fields_and_field_types)

    def __repr__(self) -> str:
        place = type(self).__module__.rpartition(".")[0]
        values = (f"{field.name}={_shown(getattr(self, field.attribute))}" for field in self.__metaros_fields__)
        return f"{place + '.' if place else ''}{type(self).__name__}({', '.join(values)})"

    def __copy__(self) -> Any:
        return refill(type(self), _contents(self), _rest(self))

    def __deepcopy__(self, memo: dict[int, Any]) -> Any:
        memo[id(self)] = made = object.__new__(type(self))
        return _fill(made, copy.deepcopy(_contents(self), memo), copy.deepcopy(_rest(self), memo))

    def __reduce_ex__(self, protocol: Any) -> tuple[Any, ...]:
        name, own = self.__metaros_name__, type(self).__mro__[1] if self._check_fields else type(self)
        if own is not message_class(name, self.__metaros_catalogue__):  # a class of the program's own
            return refill, (own, _contents(self), _rest(self))
        restore = self.__metaros_catalogue__.restore  # type: ignore[attr-defined]
        return restore, (name, self.__metaros_hash__, self._check_fields, _contents(self))


def become_checked(message: Any) -> None:
    """From now on the message checks what its fields are set to. Its class is a subclass of the same layout."""
    cls = type(message)
    checked = vars(cls).get("__metaros_checked__")
    if checked is None:
        checked = _checked_class(cls)
        type.__setattr__(cls, "__metaros_checked__", checked)
    message.__class__ = checked


def set_rest(message: Any, unknown: dict[str, Any]) -> None:
    """Keywords that are no attributes: fields named by words of Python's are set, of others AssertionError tells."""
    known = {field.name: field.attribute for field in message.__metaros_fields__}
    wrong = sorted(name for name in unknown if name not in known)
    if wrong:
        package, _, name = message.__metaros_name__.split("/")
        raise AssertionError(
            f"Invalid arguments passed to constructor: {', '.join(wrong)}; "
            f"{package}/{name} has: {', '.join(known) or 'no fields'}"
        )
    for name, value in unknown.items():
        setattr(message, name, value)


def _checked_class(cls: Any) -> Any:
    from metaros.ros2.rosidl.checks import checker

    members: dict[str, Any] = {"__module__": cls.__module__, "__qualname__": cls.__qualname__, "__doc__": cls.__doc__}
    members |= {"_check_fields": True, "__slots__": ()}
    for field in cls.__metaros_fields__:
        nested = message_class(field.type.base, cls.__metaros_catalogue__) if field.type.is_nested else None
        plain = next(vars(base)[field.attribute] for base in cls.__mro__ if field.attribute in vars(base))
        checking = _checking(plain, checker(field, nested))
        members[field.attribute] = members[f"_{field.name}"] = members[field.name] = checking
    made: Any = type(cls)(cls.__name__, (cls,), members)
    made.__slots__ = list(cls.__slots__)
    return made


def _checking(plain: Any, check: Any) -> property:
    put = plain.__set__

    def set_(message: Any, value: Any) -> None:
        check(value)
        put(message, value)

    return property(plain.__get__, set_)


def _contents(message: Any) -> tuple[Any, ...]:
    return tuple(getattr(message, field.attribute) for field in message.__metaros_fields__)


def _rest(message: Any) -> dict[str, Any] | None:
    """What a class that a program derived keeps beside the fields."""
    return vars(message) if hasattr(message, "__dict__") else None


def refill(cls: type[Any], contents: tuple[Any, ...], rest: dict[str, Any] | None) -> Any:
    """A message with those fields, as they are; `rest` is what a class that a program derived keeps beside them."""
    return _fill(object.__new__(cls), contents, rest)


def _fill(made: Any, contents: tuple[Any, ...], rest: dict[str, Any] | None) -> Any:
    for field, value in zip(made.__metaros_fields__, contents, strict=True):
        setattr(made, store(field), value)
    if rest:
        vars(made).update(rest)
    return made


def _shown(value: Any) -> str:
    return repr(value.tolist()) if isinstance(value, array) else repr(value)
