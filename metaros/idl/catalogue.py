"""The catalogue of interfaces: the common ROS 2 packages as data, and whatever a program adds.

The shipped definitions are `catalogue_data/<package>.txt`: sections that begin with `=== msg/Name` and hold the
definition's text. A package is read when one of its interfaces is first asked for.
"""

from __future__ import annotations

import os
import threading
from collections.abc import Callable, Iterator
from functools import cache
from typing import TYPE_CHECKING, Any, TypeVar, cast

from metaros.errors import ConfigError, DefinitionError, UnknownTypeError
from metaros.idl.class_shape import NATIVE, ClassShape
from metaros.idl.definitions import Definition, MessageDefinition
from metaros.idl.derived import derived_definitions, root_names, whole_message
from metaros.idl.parser import parse_action, parse_msg, parse_srv
from metaros.limits import LIMITS

if TYPE_CHECKING:
    from metaros.idl.folders import Folders

__all__ = [
    "RELEASES",
    "Catalogue",
    "default_catalogue",
    "parse_definition",
    "release_catalogue",
    "shipped_catalogue",
    "shipped_names",
]

RELEASES = ("jazzy", "kilted", "lyrical")

_VARIABLES = ("METAROS_INTERFACE_PATH", "AMENT_PREFIX_PATH")  # of `metaros.idl.folders`
_DATA = os.path.join(os.path.dirname(__file__), "catalogue_data")  # `pathlib` would cost each start 5 ms
_PARSERS: dict[str, Callable[[str, str], Definition]] = {"msg": parse_msg, "srv": parse_srv, "action": parse_action}
T = TypeVar("T")


def parse_definition(text: str, name: str) -> Definition:
    """Parse `text` as what its full name says it is: "pkg/msg/N", "pkg/srv/N" or "pkg/action/N".

    A text without `---` under the name of a part, such as "pkg/action/N_Feedback", is that message.
    """
    parts = name.split("/")
    if len(parts) != 3 or parts[1] not in _PARSERS:
        raise DefinitionError(f"{name!r} is no interface name: it must look like package/msg/Name")
    if parts[1] != "msg" and any(root_names(name)) and not any(line.strip() == "---" for line in text.splitlines()):
        return parse_msg(text, name)
    return _PARSERS[parts[1]](text, name)


class Catalogue:
    """Interfaces by full name. Thread-safe; a definition, once in, never changes.

    `base` is another catalogue to look in for what this one does not have; with None it starts empty.
    Derived interfaces ("std_srvs/srv/Trigger_Request") are found under their own names. `shape` is that of its classes.
    """

    shape: ClassShape = NATIVE

    def __init__(self, *, base: Catalogue | None = None) -> None:
        self._base = base
        self._lock = threading.RLock()
        self._own: dict[str, Definition] = {}
        self._derived: dict[str, Definition] = {}
        self._made: dict[tuple[str, str], Any] = {}

    @property
    def definitions(self) -> Catalogue:
        """Where its definitions are, with classes of the library's own shape: here."""
        return self

    def get(self, name: str) -> Definition:
        """The definition of `name`, or `UnknownTypeError`."""
        definition = self._find(name)
        if definition is None:
            trouble = self.trouble(name)
            raise UnknownTypeError(f"no interface {name!r} in the catalogue{trouble and ': '}{trouble}")
        return definition

    def message(self, name: str) -> MessageDefinition:
        """The definition of `name`, which must be a message or a part of a service or action."""
        definition = self.get(name)
        if not isinstance(definition, MessageDefinition):
            raise UnknownTypeError(f"{name!r} is a whole service or action; name one of its parts")
        return definition

    def add(self, definition: Definition) -> None:
        """Add an interface; adding it again is nothing, another definition under its name is an error.

        A catalogue with a base may define a name of the base anew; that is how two robots with different
        versions of one interface are told apart.
        """
        self.add_all([definition])

    def add_all(self, definitions: list[Definition]) -> None:
        """Add several interfaces, or none of them if one cannot be added."""
        with self._lock:
            new: dict[str, Definition] = {}
            for definition in definitions:
                present = self._lookup(definition.name) or new.get(definition.name)
                if present is not None and present != definition:
                    raise DefinitionError(f"{definition.name} is already in the catalogue with another definition")
                if present is None:
                    new[definition.name] = definition
            if new and len(self._own) + len(new) > LIMITS.type_cache:
                raise DefinitionError(f"the catalogue is full: it takes {LIMITS.type_cache} interfaces")
            for definition in new.values():
                self._own[definition.name] = definition
                self._derived.update(derived_definitions(definition))

    def names(self, kind: str | None = None) -> list[str]:
        """The sorted names of all interfaces, or of one kind: "msg", "srv" or "action"; derived ones left out."""
        names = set(self._base.names()) if self._base else set()
        names.update(self._listed())
        return sorted(name for name in names if kind is None or name.split("/")[1] == kind)

    def names_of(self, package: str) -> list[str]:
        """The same of one package, of all kinds, without reading the others."""
        prefix = f"{package}/"
        names = set(self._base.names_of(package)) if self._base else set()
        names.update(name for name in self._listed_of(package) if name.startswith(prefix))
        return sorted(names)

    def __contains__(self, name: object) -> bool:
        return isinstance(name, str) and self._find(name) is not None

    def dependencies(self, name: str) -> list[str]:
        """The names of all messages that `name` is made of, transitively, sorted, without itself."""
        return self.memo("dependencies", name, lambda: sorted(self._closure(name)))

    def home(self, name: str) -> Catalogue:
        """The catalogue down the chain of bases whose definitions of `name` and its parts are the same as here."""
        if self._base is None or any(self._lookup(part) is not None for part in (name, *self.dependencies(name))):
            return self
        return self._base.home(name)

    def memo(self, kind: str, name: str, build: Callable[[], T]) -> T:
        """What `build` made of `name` the first time: the cache of hashes, classes and codecs.

        It holds a few things an interface, and the number of interfaces is bounded.
        """
        key = (kind, name)
        made = self._made.get(key)
        if made is None:
            with self._lock:
                made = self._made.get(key)
                if made is None:
                    made = self._made[key] = build()
        return cast("T", made)

    def may_have(self, package: str) -> bool:
        """Whether it is worth asking for interfaces of a package. No lock is taken: imports ask, which hold theirs."""
        prefix = f"{package}/"
        if any(name.startswith(prefix) for name in list(self._own)):
            return True
        return self._base is not None and self._base.may_have(package)

    def trouble(self, name: str) -> str:
        """Why there is no `name`, where a file would define it and is bad; empty otherwise."""
        return "" if self._base is None else self._base.trouble(name)

    def _find(self, name: str) -> Definition | None:
        found = self._lookup(name)
        return found if found is not None or self._base is None else self._base._find(name)

    def _lookup(self, name: str) -> Definition | None:
        return self._own.get(name) or self._derived.get(name)

    def _listed(self) -> Iterator[str]:
        with self._lock:
            return iter(list(self._own))

    def _listed_of(self, package: str) -> Iterator[str]:
        return self._listed()

    def _closure(self, name: str) -> set[str]:
        found: set[str] = set()
        pending = [name]
        while pending:
            current = pending.pop()
            for part in self._parts(current):
                if part not in found:
                    found.add(part)
                    pending.append(part)
            if name in found:
                raise DefinitionError(f"{name} contains itself")
        return found

    def _parts(self, name: str) -> list[str]:
        definition = self.get(name)
        if not isinstance(definition, MessageDefinition):
            definition = whole_message(definition)
        return [field.type.base for field in definition.fields if field.type.is_nested]


def _data_files(folder: str) -> dict[str, str]:
    """The paths of a folder's data files by package; none where there is no such folder."""
    names = os.listdir(folder) if os.path.isdir(folder) else []
    return {name[:-4]: os.path.join(folder, name) for name in names if name.endswith(".txt")}


class _ShippedCatalogue(Catalogue):
    """The catalogue that reads `catalogue_data` on demand, and folders that the environment names."""

    def __init__(self, *, folders: bool = True) -> None:
        super().__init__()
        self._with_folders = folders
        self._folders: Folders | None = None
        self._unread = _data_files(_DATA)
        self._shipped = frozenset(self._unread)
        self._texts: dict[str, str] = {}

    def _lookup(self, name: str) -> Definition | None:
        found = super()._lookup(name)
        if found is not None:
            return found
        with self._lock:
            self._read(name.split("/", 1)[0])
            for candidate in (name, *root_names(name)):
                definition = None if candidate in self._own else self._take(candidate)
                if definition is not None:
                    self._own[candidate] = definition
                    self._derived.update(derived_definitions(definition))
            return super()._lookup(name)

    def _listed(self) -> Iterator[str]:
        with self._lock:
            for package in list(self._unread):
                self._read(package)
            folders = self._open_folders()
            return iter([*self._own, *self._texts, *(folders.names() if folders else ())])

    def _listed_of(self, package: str) -> Iterator[str]:
        with self._lock:
            self._read(package)
            folders = self._open_folders()
            return iter([*self._own, *self._texts, *(folders.names(package) if folders else ())])

    def _take(self, name: str) -> Definition | None:
        text = self._texts.pop(name, None)
        shipped = None if text is None else parse_definition(text, name)
        folders = self._open_folders()
        return folders.choose(name, shipped) if folders else shipped

    def _open_folders(self) -> Folders | None:
        """What looks into folders; its module is loaded only where the environment names some."""
        if self._folders is None and self._with_folders and any(map(os.environ.get, _VARIABLES)):
            from metaros.idl.folders import Folders

            self._folders = Folders()
        return self._folders

    def may_have(self, package: str) -> bool:
        """Whether it is worth asking for interfaces of a package; takes no lock."""
        return package in self._shipped or any(map(os.environ.get, _VARIABLES)) or super().may_have(package)

    def trouble(self, name: str) -> str:
        """Which file is bad, and why."""
        bad = self._folders.bad if self._folders else {}
        return next((bad[item] for item in (name, *root_names(name)) if item in bad), "")

    def _read(self, package: str) -> None:
        path = self._unread.pop(package, None)
        if path is not None:
            self._texts.update(_read_sections(package, path))


_DEFAULT = _ShippedCatalogue()  # made at import, so that two threads cannot make two with two sets of classes


def default_catalogue() -> Catalogue:
    """The catalogue of the process: the shipped packages and what the program added."""
    return _DEFAULT


def shipped_names() -> list[str]:
    """The sorted names of the interfaces that come with the library, without what the program added."""
    return shipped_catalogue().names()


@cache
def shipped_catalogue() -> Catalogue:
    """What every copy of the library has, whatever folders and programs add to `default_catalogue` here."""
    return _ShippedCatalogue(folders=False)


@cache
def release_catalogue(release: str) -> Catalogue:
    """The catalogue as a ROS 2 release defines it: "jazzy" and "kilted" are the default, "lyrical" differs a little."""
    if release not in RELEASES:
        raise ConfigError(f"{release!r} is no ROS 2 release known here: {', '.join(RELEASES)}")
    files = _data_files(os.path.join(_DATA, release))
    if not files:
        return default_catalogue()
    catalogue = Catalogue(base=default_catalogue())
    for package in sorted(files):
        for name, text in _read_sections(package, files[package]).items():
            catalogue.add(parse_definition(text, name))
    return catalogue


def _read_sections(package: str, path: str) -> dict[str, str]:
    """The texts of a package's data file by full interface name."""
    with open(path, encoding="utf-8") as file:
        sections = file.read().split("=== ")[1:]
    texts: dict[str, str] = {}
    for section in sections:
        title, _, text = section.partition("\n")
        texts[f"{package}/{title.strip()}"] = text
    return texts
