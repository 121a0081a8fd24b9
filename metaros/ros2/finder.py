"""`import rclpy`, `from std_msgs.msg import String`: the names that programs for ROS 2 know lead to modules here.

They are the very module objects of this package, not copies: `rclpy.qos.QoSProfile is metaros.ros2.rclpy…QoSProfile`.
A package of that name that is installed wins, each for itself, unless `shadow` is asked. A folder without
`__init__.py` is no package for this purpose: `launch/` and `my_msgs/` beside a program hold launch and message files.
"""

from __future__ import annotations

import importlib
import sys
import threading
from collections.abc import Sequence
from importlib.machinery import ModuleSpec
from types import ModuleType
from typing import Any, Final

from metaros.ros2.borrowed_names import lend

__all__ = ["PACKAGES", "RosFinder", "install", "installed", "uninstall"]

_HERE: Final = "metaros.ros2"
PACKAGES: Final[dict[str, str]] = {
    "ament_index_python": f"{_HERE}.ament_index_python",
    "cv_bridge": f"{_HERE}.cv_bridge",
    "launch": f"{_HERE}.launch",
    "launch_ros": f"{_HERE}.launch_ros",
    "message_filters": f"{_HERE}.message_filters",
    "rclpy": f"{_HERE}.rclpy",
    "rosidl_parser": f"{_HERE}.rosidl.parser",
    "rosidl_runtime_py": f"{_HERE}.rosidl.runtime",
    "sensor_msgs_py": f"{_HERE}.sensor_msgs_py",
    "tf2_geometry_msgs": f"{_HERE}.tf2_geometry_msgs",
    "tf2_py": f"{_HERE}.tf2_py",
    "tf2_ros": f"{_HERE}.tf2_ros",
    "tf2_sensor_msgs": f"{_HERE}.tf2_sensor_msgs",
}
_INTERFACES: Final = ("msg", "srv", "action")
_LAUNCH_HOMES: Final = {  # modules of `launch` that launch files name beside the package itself
    "action": "entities",
    "condition": "conditions",
    "event": "events",
    "event_handler": "event_handlers",
    "launch_description": "entities",
    "launch_description_entity": "entities",
    "launch_description_source": "launch_description_sources",
}


class RosFinder:  # not of importlib.abc, which would cost more than all the rest
    """Answers for the names of ROS 2 alone. It stands first, and asks the others before it gives a package of ours."""

    def __init__(self) -> None:
        self.shadow = False
        self.given: dict[str, ModuleType] = {}
        self._asking = threading.local()

    def find_spec(self, fullname: str, path: Sequence[str] | None, target: ModuleType | None = None) -> Any:
        """What the import system asks for each name; None for what is not ours."""
        top, dot, rest = fullname.partition(".")
        if dot:
            return self._part(fullname, top, rest)
        if getattr(self._asking, "on", False) or top in sys.stdlib_module_names or top == "metaros":
            return None
        self._asking.on = True
        try:
            return self._package(top)
        finally:
            self._asking.on = False

    def _package(self, name: str) -> ModuleSpec | None:
        other = _elsewhere(name, self)
        if other is not None and other.origin is not None and not self.shadow:  # a folder alone has no origin
            return None
        if name in PACKAGES:
            return self._aliased(name, PACKAGES[name])
        spec = self._made(name)
        if spec is not None and other is not None:  # beside its interfaces such a package may have modules
            spec.loader.give_path(other.submodule_search_locations or ())  # type: ignore[union-attr]
        return spec

    def _part(self, fullname: str, top: str, rest: str) -> ModuleSpec | None:
        """`rclpy.qos`, `std_msgs.msg`: only where the package it is in is ours, or a mere folder."""
        package = sys.modules.get(top)
        if package is not None and self.given.get(top) is package:
            if top not in PACKAGES:
                return self._made(fullname)
            return self._aliased(fullname, _home(top, rest))
        if rest in _INTERFACES and getattr(package, "__file__", None) is None and hasattr(package, "__path__"):
            return self._made(fullname)
        return None

    def _aliased(self, fullname: str, home: str) -> ModuleSpec | None:
        """The module `home` by another name. None where there is none, so that Python says that in its own words."""
        module = _import(home)
        if _has_parts(fullname):
            module = module or ModuleType(fullname, f"Holds the modules of `{fullname}`.")
            if not hasattr(module, "__path__"):
                module.__path__ = []
        return None if module is None else self._spec(fullname, module)

    def _made(self, fullname: str) -> ModuleSpec | None:
        """A package of messages, or its `msg`, `srv` or `action`."""
        modules: Any = _import(f"{_HERE}.rosidl.modules")
        module = None if modules is None else modules.package_module(fullname)
        return None if module is None else self._spec(fullname, module)

    def _spec(self, fullname: str, module: ModuleType) -> ModuleSpec:
        is_package = hasattr(module, "__path__") or module.__spec__ is None
        loader: Any = _Given(self, fullname, module)
        return ModuleSpec(fullname, loader, is_package=is_package)


class _Given:
    """ "Loads" a module that is there: `__spec__` says by which name it really is, and shall go on saying so."""

    def __init__(self, finder: RosFinder, name: str, module: ModuleType) -> None:
        self._finder, self._name, self._module, self._was = finder, name, module, module.__spec__

    def give_path(self, folders: Sequence[str]) -> None:
        """Python is to look for further modules of the package here."""
        self._module.__path__ = list(folders)

    def create_module(self, spec: ModuleSpec) -> ModuleType:
        """The module itself."""
        return self._module

    def exec_module(self, module: ModuleType) -> None:
        """It has run already."""
        if self._was is not None:
            module.__spec__ = self._was
        self._finder.given[self._name] = module
        lend(self._name, module)
        if self._name == "rclpy":
            _show_homes(module)


def _home(top: str, rest: str) -> str:
    """Where the module `rest` of a package of ours is."""
    if top == "rclpy":
        homes = importlib.import_module(f"{_HERE}.rclpy.module_names").HOMES
        rest = homes.get(rest, rest)
    elif top == "launch":
        rest = _LAUNCH_HOMES.get(rest, rest)
    return f"{PACKAGES[top]}.{rest}"


def _has_parts(fullname: str) -> bool:
    """Whether modules are below a name that is none itself, such as `rclpy.impl`."""
    top, _, rest = fullname.partition(".")
    if top != "rclpy" or not rest:
        return False
    homes = importlib.import_module(f"{_HERE}.rclpy.module_names").HOMES
    return any(name.startswith(f"{rest}.") for name in homes)


def _show_homes(rclpy: ModuleType) -> None:
    """`rclpy.qos` is also the name of a folder here: as an attribute, too, it is the module that programs mean.

    rclpy itself imports those modules, therefore `import rclpy` alone is enough for `rclpy.qos.QoSProfile`.
    """
    homes = importlib.import_module(f"{_HERE}.rclpy.module_names").HOMES
    for name, home in homes.items():
        if home.startswith(f"{name}."):
            module = _import(f"{rclpy.__name__}.{home}")
            if module is not None:
                setattr(rclpy, name, module)


def _import(name: str) -> ModuleType | None:
    """The module; None where it, or a package above it, does not exist. What fails inside it is raised."""
    try:
        return importlib.import_module(name)
    except ModuleNotFoundError as error:
        if error.name is not None and (name == error.name or name.startswith(f"{error.name}.")):
            return None
        raise


def _elsewhere(name: str, ours: RosFinder) -> ModuleSpec | None:
    """The package or module, or mere folder, of that name that somebody else would give."""
    for finder in sys.meta_path:
        find_spec: Any = None if finder is ours else getattr(finder, "find_spec", None)
        spec: ModuleSpec | None = None if find_spec is None else find_spec(name, None)
        if spec is not None:
            return spec
    return None


_LOCK: Final = threading.Lock()
_FINDER: Final = RosFinder()


def install(*, shadow: bool = False) -> None:
    """Make `rclpy`, message packages and what else ROS 2 programs import importable in this process.

    A real installation wins, package by package; with `shadow` ours do, in so far as nothing is imported yet. Safe to
    call again; `shadow` once asked stays.
    """
    with _LOCK:
        _FINDER.shadow = _FINDER.shadow or shadow
        if _FINDER not in sys.meta_path:
            sys.meta_path.insert(0, _FINDER)


def installed() -> bool:
    """Whether the names lead here."""
    return _FINDER in sys.meta_path


def uninstall() -> None:
    """Forget the names again, those imported included: for tests. What holds the modules goes on working."""
    with _LOCK:
        if _FINDER in sys.meta_path:
            sys.meta_path.remove(_FINDER)
        _FINDER.shadow = False
        given = dict(_FINDER.given)
        _FINDER.given.clear()
    for name, module in given.items():
        if sys.modules.get(name) is module:
            del sys.modules[name]
        parent, _, child = name.rpartition(".")
        above = given.get(parent)
        folder = None if above is None else sys.modules.get(f"{above.__name__}.{child}")
        if folder is not None and getattr(above, child, None) is module:
            setattr(above, child, folder)  # the alias had been put over the folder of the same name
