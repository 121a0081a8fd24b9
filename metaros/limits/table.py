"""What `dataclass(frozen=True, slots=True, kw_only=True)` is to the type checker, made for tables of hundreds of rows.

The standard decorator writes a function with as many arguments as there are rows and compiles it, at each start of
each program: that took a tenth of a node's start. Here one function that takes any of them serves all.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

__all__ = ["table"]


def table(**_: bool) -> Any:
    """Decorate a class of rows with defaults, or one that adds rows to such a class; options are for type checkers.

    `dataclasses.replace` and `dataclasses.fields` work on it.
    """
    return _table


def _table(cls: type[Any]) -> type[Any]:
    own = {name: cls.__dict__[name] for name in cls.__annotations__}
    defaults = {**getattr(cls.__base__, "__rows__", {}), **own}
    kept = cls.__dict__.keys() - own.keys() - {"__dict__", "__weakref__"}
    added = {
        "__slots__": tuple(own),
        "__rows__": defaults,
        "__init__": _set_rows,
        "__setattr__": _refuse,
        "__delattr__": _refuse,
        "__dataclass_fields__": _Fields(defaults),
    }
    return type(cls.__name__, cls.__bases__, {name: cls.__dict__[name] for name in kept} | added)


def _set_rows(self: Any, **given: Any) -> None:
    rows = type(self).__rows__
    for name, default in rows.items():
        object.__setattr__(self, name, given.pop(name, default))
    if given:
        raise TypeError(f"{type(self).__name__} has no {', '.join(given)}")


def _refuse(self: Any, name: str, *_: object) -> None:
    from dataclasses import FrozenInstanceError

    raise FrozenInstanceError(f"{type(self).__name__}.{name}: a table of limits does not change")


class _Fields:
    """The fields for `dataclasses`, made when it asks: programs in service do not."""

    def __init__(self, defaults: Mapping[str, Any]) -> None:
        self._defaults = defaults
        self._made: dict[str, Any] = {}

    def __get__(self, table: object, kind: type[Any]) -> dict[str, Any]:
        if not self._made:
            from dataclasses import make_dataclass

            rows = [(name, type(value), value) for name, value in self._defaults.items()]
            made = make_dataclass("Rows", rows, init=False, repr=False, eq=False, kw_only=True)
            self._made = made.__dataclass_fields__  # type: ignore[attr-defined]
        return self._made
