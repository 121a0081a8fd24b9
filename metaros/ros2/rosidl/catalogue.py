"""The classes that ROS 2 programs know: one a type, of rosidl's shape, in a catalogue over the library's own.

Codecs decode straight into them, and nodes take them as they take native classes.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, Final, TypeVar

from metaros.idl.catalogue import Catalogue, default_catalogue
from metaros.idl.class_shape import ClassShape
from metaros.idl.classes import message_class
from metaros.idl.definitions import Definition
from metaros.idl.known import catalogue_of
from metaros.ros2.rosidl.classes import make_class
from metaros.ros2.rosidl.held import store
from metaros.ros2.rosidl.message import become_checked, refill

__all__ = ["RosidlCatalogue", "interface", "restore", "rosidl_catalogue"]

T = TypeVar("T")
_SHAPE: Final = ClassShape(store=store, octet="c", arrays=True, make=make_class)
_SHARED: Final = ("hash", "dependencies", "schema")  # what does not depend on the shape of classes


def interface(name: str, catalogue: Catalogue | None = None) -> type[Any]:
    """The class of "std_msgs/msg/String", "std_srvs/srv/Trigger" or "example_interfaces/action/Fibonacci".

    Always the same object for a definition. `catalogue` is where it is looked up, the default one without it.
    `UnknownTypeError` where there is none.
    """
    return message_class(name, rosidl_catalogue(catalogue))


def rosidl_catalogue(catalogue: Catalogue | None = None) -> RosidlCatalogue:
    """The catalogue of classes of rosidl's shape over `catalogue`, or over the default one; one for each."""
    base = default_catalogue() if catalogue is None else catalogue
    if isinstance(base, RosidlCatalogue):
        return base
    return base.memo("rosidl", "", lambda: RosidlCatalogue(base))


def restore(name: str, hash_text: str, checked: bool, contents: tuple[Any, ...]) -> Any:
    """A message that was pickled; its type is looked up by name and hash."""
    made = refill(interface(name, catalogue_of(name, hash_text)), contents, None)
    if checked:
        become_checked(made)
    return made


class RosidlCatalogue(Catalogue):
    """The definitions of another catalogue, with classes and codecs of its own. What is added goes to the other."""

    shape = _SHAPE
    restore = staticmethod(restore)

    def __init__(self, definitions: Catalogue) -> None:
        super().__init__(base=definitions)
        self._definitions = definitions

    @property
    def definitions(self) -> Catalogue:
        """The catalogue that has the definitions, with native classes."""
        return self._definitions

    def add_all(self, definitions: list[Definition]) -> None:
        """Add several interfaces to the catalogue below."""
        self._definitions.add_all(definitions)

    def home(self, name: str) -> Catalogue:
        """The catalogue of this shape over the one where `name` is at home."""
        home = self._definitions.home(name)
        return self if home is self._definitions else rosidl_catalogue(home)

    def memo(self, kind: str, name: str, build: Callable[[], T]) -> T:
        """Kept here, unless it is the same for all shapes."""
        if kind in _SHARED:
            return self._definitions.memo(kind, name, build)
        return super().memo(kind, name, build)
