"""`@service` and `@action`: annotated Python classes become ROS 2 services and actions.

    @metaros.service
    class Dock:
        class Request:
            speed: float = 0.2
            battery: Battery          # a @message class, or one of metaros.interfaces
        class Response:
            done: bool

    @metaros.action
    class Drive:
        class Goal:
            metres: float
        class Result:
            driven: float
        class Feedback:
            left: float

The inner classes are message classes then, as `@metaros.message` makes them. They may be decorated so themselves, which
type checkers understand. A part that is left out is empty.
"""

from __future__ import annotations

import sys
from collections.abc import Callable, Mapping
from typing import Any, TypeVar, overload

from metaros.errors import DefinitionError, FieldError, UnknownTypeError
from metaros.idl.annotated_build import build_class
from metaros.idl.annotated_fields import Plan, plan_fields
from metaros.idl.annotated_home import checked, nested_parts, publish, set_class
from metaros.idl.annotated_names import type_name
from metaros.idl.catalogue import Catalogue, default_catalogue
from metaros.idl.classes import Action, Message, Service, message_class
from metaros.idl.definitions import ActionDefinition, MessageDefinition, ServiceDefinition
from metaros.idl.derived import derived_definitions
from metaros.idl.hashing import type_hash
from metaros.idl.known import remember

__all__ = ["action", "service"]

T = TypeVar("T")
_PARTS = {"srv": ("Request", "Response"), "action": ("Goal", "Result", "Feedback")}


@overload
def service(cls: type[T], /) -> type[T]:
    """`@service` alone."""


@overload
def service(*, name: str = "", catalogue: Catalogue | None = None) -> Callable[[type[T]], type[T]]:
    """`@service(name=…)`."""


def service(cls: type[Any] | None = None, /, *, name: str = "", catalogue: Catalogue | None = None) -> Any:
    """Make a service class of a class with inner classes `Request` and `Response`.

    `name` is the ROS name, such as "my_robot/srv/Dock"; without it, and for `catalogue`, the rules of `@message` hold.
    `FieldError` names the class and the field that has no ROS type.
    """
    return _decorator("srv", cls, name, catalogue, sys._getframe(1).f_locals)


@overload
def action(cls: type[T], /) -> type[T]:
    """`@action` alone."""


@overload
def action(*, name: str = "", catalogue: Catalogue | None = None) -> Callable[[type[T]], type[T]]:
    """`@action(name=…)`."""


def action(cls: type[Any] | None = None, /, *, name: str = "", catalogue: Catalogue | None = None) -> Any:
    """Make an action class of a class with inner classes `Goal`, `Result` and `Feedback`; otherwise as `service`."""
    return _decorator("action", cls, name, catalogue, sys._getframe(1).f_locals)


def _decorator(
    kind: str, cls: type[Any] | None, name: str, catalogue: Catalogue | None, around: Mapping[str, Any]
) -> Any:
    base = default_catalogue() if catalogue is None else catalogue

    def decorate(found: type[Any]) -> type[Any]:
        return _make(kind, found, name, base, around)

    return decorate if cls is None else decorate(cls)


def _make(kind: str, cls: type[Any], name: str, base: Catalogue, around: Mapping[str, Any]) -> type[Any]:
    _check_class(kind, cls)
    full = type_name(cls, name, kind)
    around = {**around, **vars(cls), cls.__name__: cls}
    sources = {part: _source(cls, part) for part in _PARTS[kind]}
    plans = {part: plan_fields(source, around) for part, source in sources.items()}
    parts = {
        part: checked(MessageDefinition(f"{full}_{part}", plan.fields, plan.constants), sources[part])
        for part, plan in plans.items()
    }
    made_of = {part.lower(): definition for part, definition in parts.items()}
    whole = (ServiceDefinition if kind == "srv" else ActionDefinition)(full, **made_of)
    nested = [item for plan in plans.values() for item in nested_parts(plan, base)]
    own = Catalogue(base=base)
    try:
        own.add_all([whole, *(part for part, _ in nested)])
        for item, item_class in nested:
            set_class(own, item.name, item_class)
        made = _build(cls, kind, whole, own, {part: (sources[part], plans[part], parts[part]) for part in parts})
        names = [full, *derived_definitions(whole)]
        for found in names:
            remember(found, own)
        publish(whole, {found: message_class(found, own) for found in names}, nested, base)
    except (DefinitionError, UnknownTypeError) as error:
        raise FieldError(f"{cls.__qualname__}: {error}") from None
    return made


def _check_class(kind: str, cls: Any) -> None:
    word, parts = ("service", _PARTS["srv"]) if kind == "srv" else ("action", _PARTS["action"])
    if not isinstance(cls, type):
        raise FieldError(f"@{word} is for classes, not for {cls!r}")
    listed = ", ".join(parts)
    inner = {name for name, value in vars(cls).items() if isinstance(value, type)}
    trouble = ""
    if "__metaros_name__" in vars(cls):
        trouble = "it is an interface already"
    elif vars(cls).get("__annotations__"):
        trouble = f"fields belong into its inner classes {listed}, not into the {word} itself"
    elif not inner.intersection(parts):
        trouble = f"a class with @{word} has inner classes {listed}"
    else:
        others = [part for part in (*_PARTS["srv"], *_PARTS["action"]) if part not in parts and part in inner]
        if others:
            trouble = f"{others[0]} is no part of an interface of this kind, which has {listed}"
    if trouble:
        raise FieldError(f"{cls.__qualname__}: {trouble}")


def _source(cls: type[Any], part: str) -> type[Any]:
    """The inner class as it is to be made a message: a `@message` class stays what it is, and is derived from."""
    found = vars(cls).get(part)
    where = {"__module__": cls.__module__, "__qualname__": f"{cls.__qualname__}.{part}"}
    if found is None:
        return type(part, (), where)
    if not isinstance(found, type):
        raise FieldError(f"{cls.__qualname__}.{part}: a class is needed, not {found!r}")
    if issubclass(found, Message):
        return type(part, (found,), {**where, "__doc__": found.__doc__})
    return found


def _build(
    cls: type[Any],
    kind: str,
    whole: ServiceDefinition | ActionDefinition,
    own: Catalogue,
    parts: Mapping[str, tuple[type[Any], Plan, MessageDefinition]],
) -> type[Any]:
    members = {name: value for name, value in vars(cls).items() if name not in ("__dict__", "__weakref__")}
    for part, (source, plan, definition) in parts.items():
        members[part] = build_class(source, plan, definition, own)
        members[part].__metaros_hash__ = type_hash(definition.name, own)
        members[part].__qualname__ = f"{cls.__name__}.{part}"  # where pickles find it
        set_class(own, definition.name, members[part])
    if kind == "srv":
        members["Event"] = message_class(f"{whole.name}_Event", own)
    members |= {
        "__doc__": cls.__doc__ or f"The interface {whole.name}.",
        "__metaros_name__": whole.name,
        "__metaros_hash__": type_hash(whole.name, own),
        "__metaros_catalogue__": own,
    }
    base: type[Any] = Service if kind == "srv" else Action
    bases = (*(item for item in cls.__bases__ if item is not object), base)
    metaclass: Any = type(cls)
    made: type[Any] = metaclass(cls.__name__, bases, members)
    set_class(own, whole.name, made)
    return made
