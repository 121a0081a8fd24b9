"""The metaclass of message, service and action classes: what rclpy's programs ask of `Msg.__class__`."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, NamedTuple

__all__ = ["Computed", "RosidlType", "TypeSupport"]


class TypeSupport(NamedTuple):
    """What stands for rosidl's compiled type support: the type's full name and hash."""

    name: str
    hash: str


class RosidlType(type):
    """Keeps constants and defaults from being overwritten, and holds the places of the type support.

    Each class has a metaclass of its own, named `Metaclass_<Name>`, as rosidl's have.
    """

    _CREATE_ROS_MESSAGE: Any = None
    _CONVERT_FROM_PY: Any = None
    _CONVERT_TO_PY: Any = None
    _DESTROY_ROS_MESSAGE: Any = None
    _TYPE_SUPPORT: TypeSupport | None = None
    _support: TypeSupport | None = None
    _is_message: bool = False
    _fixed_names: frozenset[str] = frozenset()

    @classmethod
    def __import_type_support__(mcs) -> None:
        """Fill `_TYPE_SUPPORT`; there is nothing to be loaded."""
        mcs._TYPE_SUPPORT = mcs._support
        if mcs._is_message:
            mcs._CREATE_ROS_MESSAGE = mcs._CONVERT_FROM_PY = mcs._CONVERT_TO_PY = mcs._support
            mcs._DESTROY_ROS_MESSAGE = mcs._support

    def __setattr__(cls, name: str, value: Any) -> None:
        if name in cls._fixed_names:
            raise AttributeError(f"{cls.__name__}.{name} is a constant of the interface: it cannot be set")
        super().__setattr__(name, value)

    def __delattr__(cls, name: str) -> None:
        if name in cls._fixed_names:
            raise AttributeError(f"{cls.__name__}.{name} is a constant of the interface: it cannot be deleted")
        super().__delattr__(name)


class Computed:
    """A class attribute that is made when it is read: each time, or once if `keep` is the name to keep it under."""

    __slots__ = ("_keep", "_make", "_owner")

    def __init__(self, make: Callable[[], Any], *, keep: str = "") -> None:
        self._make, self._keep = make, keep
        self._owner: type[Any] | None = None

    def __set_name__(self, owner: type[Any], name: str) -> None:
        self._owner = owner

    def __get__(self, instance: Any, owner: type[Any] | None = None) -> Any:
        value = self._make()
        if self._keep and self._owner is not None:
            setattr(self._owner, self._keep, value)
        return value
