"""`rosidl_runtime_py.import_message`: the class that a `SLOT_TYPES` entry names."""

from __future__ import annotations

import importlib
import warnings
from typing import Any

from metaros.idl.catalogue import default_catalogue
from metaros.ros2.rosidl.catalogue import interface

__all__ = ["import_message_from_namespaced_type"]


def import_message_from_namespaced_type(message_type: Any) -> Any:
    """The class of a `NamespacedType`: of the catalogue, else of an installed package.

    Arrays of such types are taken too, with a DeprecationWarning. ImportError or AttributeError where there is none.
    """
    if not hasattr(message_type, "namespaces") and hasattr(message_type, "value_type"):
        warnings.warn(
            "give the NamespacedType itself, not an array or a sequence of it", DeprecationWarning, stacklevel=2
        )
        message_type = message_type.value_type
    name = "/".join((*message_type.namespaces, message_type.name))
    if name in default_catalogue():
        return interface(name)
    return getattr(importlib.import_module(".".join(message_type.namespaces)), message_type.name)
