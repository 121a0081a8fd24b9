"""How the message classes of a catalogue are shaped: what makes them, and where the codecs find their fields.

The library's own classes keep a field under its own name. Classes that convert what is read or set, such as those of
`metaros.ros2`, keep what was received under another name, which only codecs use.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from operator import attrgetter
from typing import Any, Final

from metaros.idl.definitions import Field

__all__ = ["NATIVE", "ClassShape"]


@dataclass(frozen=True, slots=True)
class ClassShape:
    """`store` names the attribute in which codecs read and write a field; `octet` is the struct code of one `byte`.

    `arrays` says that sequences of numbers are mostly `array.array`, which the encoder then takes as fast as numpy's.

    `make(name, catalogue)` makes the class of an interface; None leaves it to `message_class`.
    """

    store: Callable[[Field], str]
    octet: str = "B"
    arrays: bool = False
    make: Callable[[str, Any], type[Any]] | None = None


NATIVE: Final = ClassShape(store=attrgetter("attribute"))
