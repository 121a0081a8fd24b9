"""`std_msgs`, `std_msgs.msg`, `std_msgs.msg._string` as modules, for every package of the default catalogue.

Classes are made when they are asked for, so that importing a package costs next to nothing.
"""

from __future__ import annotations

import threading
from collections.abc import Callable
from importlib.machinery import ModuleSpec
from types import ModuleType
from typing import Any, Final

from metaros.idl.catalogue import default_catalogue
from metaros.idl.definitions import ActionDefinition, ServiceDefinition
from metaros.idl.derived import derived_definitions
from metaros.ros2.rosidl.catalogue import interface
from metaros.ros2.rosidl.naming import snake_case

__all__ = ["package_module"]

_KINDS: Final = ("msg", "srv", "action")
_LOCK: Final = threading.RLock()
_MADE: Final[dict[str, ModuleType]] = {}


def package_module(fullname: str) -> ModuleType | None:
    """The module of that name, always the same one; None where the catalogue has no such package, kind or class.

    "std_msgs" and "std_msgs.msg" are packages, "std_msgs.msg._string" is what rosidl generates of `String.msg`.
    """
    if not default_catalogue().may_have(fullname.partition(".")[0]):
        return None
    with _LOCK:
        found = _MADE.get(fullname)
        if found is None:
            found = _make(fullname)
            if found is not None:
                _MADE[fullname] = found
        return found


def _make(fullname: str) -> ModuleType | None:
    package, *rest = fullname.split(".")
    names = default_catalogue().names_of(package)
    if not rest:
        return _package(package) if names else None
    kind = rest[0]
    of_kind = [name for name in names if name.startswith(f"{package}/{kind}/")]
    if not of_kind or kind not in _KINDS:
        return None
    if len(rest) == 1:
        return _kind(package, kind)
    if len(rest) == 2 and rest[1].startswith("_"):
        root = next((name for name in of_kind if snake_case(name.split("/")[2]) == rest[1][1:]), None)
        return None if root is None else _file(fullname, root)
    return None


def _package(package: str) -> ModuleType:
    def find(name: str) -> Any:
        return package_module(f"{package}.{name}") if name in _KINDS else None

    def listed() -> list[str]:
        return [kind for kind in _KINDS if package_module(f"{package}.{kind}") is not None]

    return _module(package, f"The interfaces of {package}.", find, listed, is_package=True)


def _kind(package: str, kind: str) -> ModuleType:
    prefix = f"{package}/{kind}/"

    def roots() -> list[str]:
        return [name for name in default_catalogue().names_of(package) if name.startswith(prefix)]

    def find(name: str) -> Any:
        if name.startswith("_"):
            return package_module(f"{package}.{kind}.{name}")
        if prefix + name in default_catalogue():
            return interface(prefix + name)
        if trouble := default_catalogue().trouble(prefix + name):
            raise ImportError(f"{package}.{kind}.{name}: {trouble}")
        return None

    def listed() -> list[str]:
        return [name.split("/")[2] for root in roots() for name in _with_parts(root)]

    return _module(f"{package}.{kind}", f"The interfaces of {package}/{kind}.", find, listed, is_package=True)


def _file(fullname: str, root: str) -> ModuleType:
    """What rosidl generates of one file: its class or classes, and their metaclasses."""
    prefix = root.rpartition("/")[0]

    def find(name: str) -> Any:
        plain = name.removeprefix("Metaclass_")
        if plain not in listed():
            return None
        found = interface(f"{prefix}/{plain}")
        return found if plain == name else type(found)

    def listed() -> list[str]:
        return [name.split("/")[2] for name in _with_parts(root)]

    return _module(fullname, f"The interface {root}.", find, listed, is_package=False)


def _with_parts(root: str) -> list[str]:
    """An interface and the halves of a service, or what an action is made of."""
    kind = root.split("/")[1]
    if kind == "msg":
        return [root]
    definition = default_catalogue().get(root)
    parts = derived_definitions(definition)
    if isinstance(definition, ActionDefinition):
        for part in list(parts.values()):
            if isinstance(part, ServiceDefinition):
                parts |= derived_definitions(part)
    return [root, *(name for name in parts)]


def _module(
    fullname: str, about: str, find: Callable[[str], Any], listed: Callable[[], list[str]], *, is_package: bool
) -> ModuleType:
    module = ModuleType(fullname, about)
    module.__spec__ = ModuleSpec(fullname, None, is_package=is_package)
    module.__package__ = fullname if is_package else fullname.rpartition(".")[0]
    if is_package:
        module.__path__ = []

    def get(name: str) -> Any:
        if name == "__all__":
            return listed()
        found = None if name.startswith("__") else find(name)
        if found is None:
            raise AttributeError(f"module {fullname!r} has no attribute {name!r}")
        setattr(module, name, found)
        return found

    vars(module).update(__getattr__=get, __dir__=lambda: sorted({*vars(module), *listed()}))
    return module
