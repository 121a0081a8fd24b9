"""The generated methods of a `@message` class: a constructor by keywords and equality, as one would write them."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

from metaros.idl.arrays import DTYPES, as_array, same_values
from metaros.idl.catalogue import Catalogue
from metaros.idl.classes import equality_source, maker, reject_unknown, zero
from metaros.idl.definitions import MessageDefinition

__all__ = ["methods"]


def methods(
    definition: MessageDefinition,
    catalogue: Catalogue,
    factories: Mapping[str, Callable[[], Any]],
    *,
    held: set[str],
    after: bool,
) -> dict[str, Any]:
    """`__init__` and `__eq__`. `factories` make defaults, `held` attributes convert what is assigned to them.

    With `after` the constructor ends by calling `__post_init__()`.
    """
    scope: dict[str, Any] = {"_same": same_values, "_as_array": as_array, "_reject": reject_unknown}
    parameters, body = [], ["if _unknown: _reject(_self, _unknown)"]
    for number, field in enumerate(definition.fields):
        name, default, kind = field.attribute, f"_d{number}", field.type
        factory = factories.get(name)
        if factory is None and not (kind.is_nested or kind.array):
            scope[default] = zero(kind)
            parameters.append(f"{name}={default}")
            body.append(f"_self.{name} = {name}")
            continue
        scope[default] = maker(kind, None, catalogue) if factory is None else factory
        flat = kind.array and kind.base in DTYPES and name not in held
        given = f"_as_array({name}, {kind.base!r})" if flat else name
        parameters.append(f"{name}=_missing")
        body.append(f"_self.{name} = {default}() if {name} is _missing else {given}")
    scope["_missing"] = _MISSING
    if after:
        body.append("_self.__post_init__()")
    star = ["*"] if parameters else []
    lines = [
        f"def __init__(_self, {', '.join([*star, *parameters, '**_unknown'])}):",
        *(f"    {line}" for line in body),
    ]
    exec(compile("\n".join([*lines, *equality_source(definition.fields)]), f"<{definition.name}>", "exec"), scope)
    return {"__init__": scope["__init__"], "__eq__": scope["__eq__"]}


class _Missing:
    def __repr__(self) -> str:
        return "…"


_MISSING = _Missing()
