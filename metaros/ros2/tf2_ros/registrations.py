"""Which types a buffer can transform, and how one type becomes another: tables that packages add to when imported."""

from __future__ import annotations

import copy
from collections.abc import Callable
from typing import Any, ClassVar

__all__ = ["ConvertRegistration", "NotImplementedException", "TransformRegistration", "TypeException", "convert"]


class TypeException(Exception):
    """No package that was imported knows how to transform or convert this type."""

    def __init__(self, errstr: str) -> None:
        super().__init__(errstr)
        self.errstr = errstr


class NotImplementedException(Exception):
    """A kind of buffer that cannot look up."""

    def __init__(self) -> None:
        self.errstr = "CanTransform or LookupTransform not implemented"
        super().__init__(self.errstr)


class TransformRegistration:
    """By type: the function of (object, TransformStamped) that gives the object in the other frame."""

    __type_map: ClassVar[dict[Any, Callable[[Any, Any], Any]]] = {}

    def print_me(self) -> None:
        """Show the table."""
        print(self.__type_map)

    def add(self, key: Any, callback: Callable[[Any, Any], Any]) -> None:
        """Know how to transform objects of this type, in every buffer of the process."""
        self.__type_map[key] = callback

    def get(self, key: Any) -> Callable[[Any, Any], Any]:
        """The function for a type.

        Raises:
            TypeException: there is none.
        """
        found = self.__type_map.get(key)
        if found is None:
            raise TypeException(_unknown(key))
        return found


class ConvertRegistration:
    """By type: functions to its message and from it, and from type to type directly."""

    __to_msg_map: ClassVar[dict[Any, Callable[[Any], Any]]] = {}
    __from_msg_map: ClassVar[dict[Any, Callable[[Any], Any]]] = {}
    __convert_map: ClassVar[dict[Any, Callable[[Any], Any]]] = {}

    def add_from_msg(self, key: Any, callback: Callable[[Any], Any]) -> None:
        """How a message becomes an object of this type."""
        self.__from_msg_map[key] = callback

    def add_to_msg(self, key: Any, callback: Callable[[Any], Any]) -> None:
        """How an object of this type becomes a message."""
        self.__to_msg_map[key] = callback

    def add_convert(self, key: tuple[Any, Any], callback: Callable[[Any], Any]) -> None:
        """How the first of two types becomes the second."""
        self.__convert_map[key] = callback

    def get_from_msg(self, key: Any) -> Callable[[Any], Any]:
        """As added. TypeException where it was not."""
        return _found(self.__from_msg_map, key)

    def get_to_msg(self, key: Any) -> Callable[[Any], Any]:
        """As added. TypeException where it was not."""
        return _found(self.__to_msg_map, key)

    def get_convert(self, key: tuple[Any, Any]) -> Callable[[Any], Any]:
        """As added. TypeException where it was not."""
        return _found(self.__convert_map, key)


def convert(a: Any, b_type: Any) -> Any:
    """The object as another type: directly, as a copy where it is of that type, else by way of its message.

    Raises:
        TypeException: nobody knows how.
    """
    known = ConvertRegistration()
    try:
        direct = known.get_convert((type(a), b_type))
    except TypeException:
        if type(a) is b_type:
            return copy.deepcopy(a)
        return known.get_from_msg(b_type)(known.get_to_msg(type(a))(a))
    return direct(a)


def _found(table: dict[Any, Callable[[Any], Any]], key: Any) -> Callable[[Any], Any]:
    found = table.get(key)
    if found is None:
        raise TypeException(_unknown(key))
    return found


def _unknown(key: Any) -> str:
    module = str(getattr(key, "__module__", ""))
    package = "tf2_sensor_msgs" if "sensor_msgs" in module else "tf2_geometry_msgs" if "geometry_msgs" in module else ""
    hint = f": import {package}, which knows it" if package else ""
    return f"Type {key} is not loaded or supported{hint}"
