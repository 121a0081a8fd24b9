"""Where rosidl's generator puts a class: `std_msgs.msg._string`, one module a message, service or action file."""

from __future__ import annotations

from metaros.idl.catalogue import Catalogue
from metaros.idl.derived import root_names

__all__ = ["module_name", "snake_case"]


def snake_case(name: str) -> str:
    """The module of a class, without the `_` before it: "UInt8MultiArray" is in "u_int8_multi_array"."""
    words: list[str] = []
    for index, char in enumerate(name):
        before, after = name[index - 1 : index], name[index + 1 : index + 2]
        if index and char.isupper() and ("a" <= after <= "z" or "a" <= before <= "z" or before.isdigit()):
            words.append("_")
        words.append(char.lower())
    return "".join(words)


def module_name(name: str, catalogue: Catalogue) -> str:
    """The module of an interface's class; parts of a service or an action are in that one's."""
    root = next((item for item in root_names(name) if item in catalogue and not any(root_names(item))), name)
    package, kind, short = root.split("/")
    return f"{package}.{kind}._{snake_case(short)}"
