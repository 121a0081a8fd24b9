"""The names that ROS 2 programs import lead to modules of ours, and to a real installation where there is one."""

from __future__ import annotations

import importlib
import sys
import threading
from collections.abc import Iterator
from importlib.util import spec_from_file_location
from pathlib import Path
from types import ModuleType
from typing import Any

import pytest

import metaros.ros2.rclpy
from metaros.ros2 import finder, install, installed, uninstall
from metaros.ros2.rclpy import module_names
from metaros.ros2.rosidl.catalogue import interface


@pytest.fixture
def clean() -> Iterator[None]:
    """Nothing stays installed."""
    uninstall()
    yield
    uninstall()


@pytest.fixture
def elsewhere(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, clean: None) -> Iterator[Path]:
    """A folder for "installed" packages."""
    monkeypatch.syspath_prepend(tmp_path)
    yield tmp_path
    for name in [
        name for name in sys.modules if name.partition(".")[0] in ("rclpy", "tf2_ros", "std_msgs", "std_srvs")
    ]:
        del sys.modules[name]


def load(name: str) -> ModuleType:
    """Import by name, as a program does."""
    return importlib.import_module(name)


@pytest.mark.usefixtures("clean")
def test_the_names_are_our_modules_and_go_away_again() -> None:
    before = dict(sys.modules)
    with pytest.raises(ModuleNotFoundError):
        load("rclpy")
    install()
    install()
    assert installed()
    assert [finder_ for finder_ in sys.meta_path if isinstance(finder_, finder.RosFinder)] == [sys.meta_path[0]]
    assert load("rclpy") is metaros.ros2.rclpy
    assert load("rclpy.module_names") is module_names
    assert module_names.__spec__ is not None
    assert module_names.__spec__.name == "metaros.ros2.rclpy.module_names"
    for name in ("rclpy.nothing", "rclpy.nothing.more"):
        with pytest.raises(ModuleNotFoundError, match=r"No module named 'rclpy\.nothing"):
            load(name)
    uninstall()
    assert [name for name in sys.modules if name not in before and not name.startswith("metaros.")] == []
    with pytest.raises(ModuleNotFoundError):
        load("rclpy")


@pytest.mark.filterwarnings("ignore::UserWarning")  # of rclpy.qos_event, which is deprecated
@pytest.mark.usefixtures("clean")
def test_every_module_in_the_table_is_there_by_both_names() -> None:
    install()
    wrong = []
    for name, home in module_names.HOMES.items():
        if load(f"rclpy.{name}") is not load(f"metaros.ros2.rclpy.{home}"):
            wrong.append(name)
    assert wrong == []


@pytest.mark.usefixtures("clean")
def test_a_module_with_the_name_of_a_folder_here_wins_as_an_attribute_and_goes_away(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    own = ModuleType("metaros.ros2.rclpy.names.rules")
    folder = load("metaros.ros2.rclpy.names")
    monkeypatch.setitem(sys.modules, own.__name__, own)
    monkeypatch.setitem(module_names.HOMES, "names", "names.rules")
    install()
    assert load("rclpy").names is own
    assert load("rclpy.names") is own
    uninstall()
    assert load("metaros.ros2.rclpy").names is folder


@pytest.mark.usefixtures("clean")
def test_a_name_that_only_has_modules_below_it_can_be_imported(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(module_names.HOMES, "hold.table", "module_names")
    install()
    assert load("rclpy.hold.table") is module_names
    assert load("rclpy").hold.table is module_names


@pytest.mark.usefixtures("clean")
def test_packages_of_messages_and_all_else_that_programs_import() -> None:
    install()
    assert load("std_msgs.msg").String is interface("std_msgs/msg/String")
    assert load("std_srvs.srv").Trigger is interface("std_srvs/srv/Trigger")
    assert load("example_interfaces.action").Fibonacci is interface("example_interfaces/action/Fibonacci")
    for name, home in finder.PACKAGES.items():
        assert load(name) is load(home)
    assert load("rosidl_parser.definition") is load("metaros.ros2.rosidl.parser.definition")
    for name in ("std_msgs.nothing", "no_such_msgs", "no_such_msgs.msg", "tf2_ros.nothing"):
        with pytest.raises(ModuleNotFoundError):
            load(name)
    uninstall()
    with pytest.raises(ModuleNotFoundError):
        load("std_msgs.msg")


def test_an_installed_package_wins_each_for_itself_unless_shadowed(elsewhere: Path) -> None:
    (elsewhere / "rclpy").mkdir()
    (elsewhere / "rclpy" / "__init__.py").write_text("real = True\n")
    (elsewhere / "rclpy" / "qos.py").write_text("real = True\n")
    (elsewhere / "std_msgs" / "msg").mkdir(parents=True)
    (elsewhere / "std_msgs" / "__init__.py").touch()
    (elsewhere / "std_msgs" / "msg" / "__init__.py").write_text("real = True\n")
    (elsewhere / "tf2_ros").mkdir()  # a folder is no package
    (elsewhere / "std_srvs" / "srv").mkdir(parents=True)  # of interface files
    install()
    assert load("rclpy").real
    assert load("rclpy.qos").real
    assert load("std_msgs.msg").real
    assert load("tf2_ros") is load("metaros.ros2.tf2_ros")
    assert load("std_srvs.srv").Trigger is interface("std_srvs/srv/Trigger")
    for name in ("rclpy", "rclpy.qos", "std_msgs", "std_msgs.msg"):
        del sys.modules[name]
    (elsewhere / "std_msgs" / "tools.py").write_text("real = True\n")
    importlib.invalidate_caches()
    install(shadow=True)
    assert load("rclpy") is metaros.ros2.rclpy
    assert load("std_msgs.tools").real  # beside its interfaces a package may have modules
    assert load("std_msgs.msg").String is interface("std_msgs/msg/String")


@pytest.mark.parametrize("how", ["imported before", "in a folder", "by a finder of its own"])
def test_what_is_installed_wins_however_it_is_and_whenever_it_came(
    elsewhere: Path, monkeypatch: pytest.MonkeyPatch, how: str
) -> None:
    """Editable installs put a finder behind all others; programs may import before and after `install`."""
    home = elsewhere if how != "by a finder of its own" else elsewhere / "src"
    names = ("rclpy", "rclpy.node", "std_msgs.msg", "tf2_ros")
    for name in names:
        folder = home.joinpath(*name.split("."))
        folder.mkdir(parents=True, exist_ok=True)
        for path in (folder, folder.parent):
            if path != home:
                (path / "__init__.py").write_text("real = True\n")
    importlib.invalidate_caches()

    class Editable:
        @staticmethod
        def find_spec(name: str, path: object = None, target: object = None) -> Any:
            folder = home / name
            if "." in name or not folder.is_dir():
                return None
            return spec_from_file_location(name, folder / "__init__.py", submodule_search_locations=[str(folder)])

    if how == "by a finder of its own":
        monkeypatch.setattr(sys, "meta_path", [*sys.meta_path, Editable])
    if how == "imported before":
        load("rclpy")
    install()
    load("metaros.ros2.rclpy.core.node")  # ours, by their own names, are no reason to give them for theirs
    assert [name for name in names if not load(name).real] == []
    assert load("message_filters") is load("metaros.ros2.message_filters")


@pytest.mark.usefixtures("clean")
def test_threads_that_import_at_once_get_the_same_modules() -> None:
    install()
    found: list[ModuleType] = []
    gate = threading.Barrier(8)

    def work() -> None:
        gate.wait()
        found.append(load("rclpy.module_names"))

    threads = [threading.Thread(target=work) for _ in range(8)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert found == [module_names] * 8
