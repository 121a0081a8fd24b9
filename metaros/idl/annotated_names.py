"""ROS names for `@message`, `@service` and `@action` classes and their fields."""

from __future__ import annotations

import re
import sys
from keyword import iskeyword
from pathlib import Path
from typing import Any

from metaros.errors import FieldError

__all__ = ["field_name", "is_constant_name", "type_name"]

_FULL = re.compile(r"[a-z][a-z0-9]*(?:_[a-z0-9]+)*/(msg|srv|action)/[A-Z][A-Za-z0-9]*\Z")
_WORDS = {"msg": "message", "srv": "service", "action": "action"}
_SHORT = re.compile(r"[A-Z][A-Za-z0-9]*\Z")
_FIELD = re.compile(r"[a-z][a-z0-9]*(?:_[a-z0-9]+)*\Z")
_CONSTANT = re.compile(r"[A-Z][A-Z0-9]*(?:_[A-Z0-9]+)*\Z")
_MAX_CHARS = 128  # of a package or class: the name travels in every key


def type_name(cls: type[Any], wanted: str, kind: str = "msg") -> str:
    """The full name of a class's type: `wanted`, or made of its module and name. `kind` is "msg", "srv" or "action"."""
    word = _WORDS[kind]
    if wanted:
        match = _FULL.match(wanted)
        if not match or match[1] != kind or len(wanted) > 2 * _MAX_CHARS:
            raise FieldError(f"{cls.__qualname__}: {wanted[:80]!r} is no {word} name like my_robot/{kind}/Battery")
        return wanted
    if not _SHORT.match(cls.__name__) or len(cls.__name__) > _MAX_CHARS:
        raise FieldError(
            f"{cls.__qualname__}: {cls.__name__[:80]!r} is illegal as a ROS type name: "
            f"letters and digits, beginning with a capital; rename the class or give @{word} a name="
        )
    return f"{_package(cls)}/{kind}/{cls.__name__}"


def field_name(attribute: str) -> str:
    """The ROS name of an attribute: `from_` is `from`, because Python reserves the word."""
    name = attribute[:-1] if attribute.endswith("_") and iskeyword(attribute[:-1]) else attribute
    if not _FIELD.match(name) or len(name) > _MAX_CHARS:
        hint = re.sub(r"_+", "_", re.sub(r"(?<=[a-z0-9])(?=[A-Z])", "_", name).lower()).strip("_")
        better = f"; perhaps {hint}" if _FIELD.match(hint) else ""
        raise FieldError(
            "the name is illegal in ROS: lower case letters, digits and single underscores, "
            f"beginning with a letter{better}"
        )
    return name


def is_constant_name(name: str) -> bool:
    """Whether a class variable of this name is a constant of the interface."""
    return bool(_CONSTANT.match(name))


def _package(cls: type[Any]) -> str:
    module = cls.__module__.partition(".")[0]
    if module in ("__main__", "__mp_main__"):
        main = sys.modules.get(cls.__module__)
        spec, file = getattr(main, "__spec__", None), getattr(main, "__file__", None)
        if spec is not None and spec.name != module:  # python -m package.module
            module = spec.name.partition(".")[0]
        else:
            module = Path(file).stem if file else "interactive"
    legal = re.sub(r"_+", "_", re.sub(r"[^a-z0-9]", "_", module.lower())).strip("_")
    if not legal or not legal[0].isalpha():
        legal = f"pkg_{legal}".rstrip("_")
    return legal[:_MAX_CHARS].rstrip("_")
