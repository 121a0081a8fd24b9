"""The class that `@message` makes: slots, a constructor by keywords and equality, as one would write them."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from types import CellType, FunctionType
from typing import Any

from metaros.errors import FieldError
from metaros.idl.annotated_fields import Plan
from metaros.idl.arrays import DTYPES, as_array, same_values
from metaros.idl.catalogue import Catalogue
from metaros.idl.classes import Message, equality_source, maker, reject_unknown, zero
from metaros.idl.definitions import Field, MessageDefinition

__all__ = ["build_class", "methods"]


def build_class(cls: type[Any], plan: Plan, definition: MessageDefinition, catalogue: Catalogue) -> type[Any]:
    """The message class of an annotated class; it keeps name, methods and annotations."""
    kept = {name: value for name, value in vars(cls).items() if name not in ("__dict__", "__weakref__")}
    own = [item for item in definition.fields if item.attribute in plan.own]
    for item in own:
        kept.pop(item.attribute, None)
    factories = {**getattr(cls, "__metaros_factories__", {}), **plan.factories}
    body: dict[str, Any] = {
        "__slots__": tuple(item.attribute for item in own),
        "__hash__": None,
        "__repr__": _repr,
        "__metaros_name__": definition.name,
        "__metaros_catalogue__": catalogue,
        "__metaros_fields__": definition.fields,
        "__metaros_factories__": factories,
        "__doc__": cls.__doc__ or f"The message {definition.name}.",
    }
    inherited = set().union(*(getattr(item, "__metaros_held__", ()) for item in cls.__mro__))
    held = inherited | plan.holders.keys()
    body["__metaros_held__"] = frozenset(held)
    body |= methods(definition, catalogue, factories, held=held, after=hasattr(cls, "__post_init__"))
    explicit = {name: value for name, value in kept.items() if name not in ("__hash__", "__doc__")}
    if kept.get("__hash__") is not None:
        explicit["__hash__"] = kept["__hash__"]
    bases = tuple(Message if item is object else item for item in cls.__bases__)
    metaclass: Any = type(cls)
    made: type[Any] = metaclass(cls.__name__, bases, {**body, **explicit})
    for attribute, hold in plan.holders.items():
        setattr(made, attribute, _held(made, attribute, hold))
    _move_methods(cls, made)
    return made


def _held(cls: type[Any], attribute: str, hold: Callable[[Any], Any]) -> property:
    """The slot behind a setter; reading it costs what a slot costs."""
    slot = vars(cls)[attribute]
    put, where = slot.__set__, f"{cls.__qualname__}.{attribute}"

    def set_(instance: Any, value: Any) -> None:
        try:
            put(instance, hold(value))
        except (FieldError, TypeError, ValueError, OverflowError) as error:
            raise FieldError(f"{where}: {error}") from None

    return property(slot.__get__, set_)


def _move_methods(old: type[Any], new: type[Any]) -> None:
    """`super()` and `__class__` in methods mean the class they were compiled in: make that the new one."""
    for value in vars(new).values():
        for function in _functions(value):
            for cell in function.__closure__ or ():
                if _content(cell) is old:
                    cell.cell_contents = new


def _functions(value: Any) -> Iterator[FunctionType]:
    parts = (value, getattr(value, "__func__", None), *(getattr(value, part, None) for part in ("fget", "fset")))
    return (part for part in parts if isinstance(part, FunctionType))


def _content(cell: CellType) -> Any:
    try:
        return cell.cell_contents
    except ValueError:  # empty still
        return None


def _repr(self: Any) -> str:
    fields: tuple[Field, ...] = self.__metaros_fields__
    values = (f"{item.attribute}={_shown(getattr(self, item.attribute))}" for item in fields)
    return f"{type(self).__qualname__}({', '.join(values)})"


def _shown(value: Any) -> str:
    if isinstance(value, bytes) and len(value) > 32:
        return f"<bytes[{len(value)}]>"
    if hasattr(value, "dtype"):
        return repr(value.tolist()) if value.size <= 32 else f"<{value.dtype}{list(value.shape)}>"
    return repr(value)


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
