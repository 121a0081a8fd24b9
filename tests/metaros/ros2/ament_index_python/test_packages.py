"""The index of installed packages, and packages that are run from their source."""

from __future__ import annotations

import os
import sys
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest

from metaros.ros2 import ament_index_python as ament


@pytest.fixture
def prefixes(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> list[str]:
    """Two, of which the first wins, and one that does not exist."""
    for prefix, names in (("one", ["foo", "bar"]), ("two", ["bar", "baz"])):
        index = tmp_path / prefix / ament.RESOURCE_INDEX_SUBFOLDER
        for kind in ("packages", f"kind_{prefix}"):
            (index / kind / "a_folder").mkdir(parents=True)
            (index / kind / ".hidden").touch()
            for name in names:
                (index / kind / name).write_text(f"{name} of {prefix}")
        (tmp_path / prefix / "share" / names[0]).mkdir(parents=True)
    found = [str(tmp_path / "one"), str(tmp_path / "two")]
    monkeypatch.setenv("AMENT_PREFIX_PATH", os.pathsep.join([*found, "", str(tmp_path / "three")]))
    return found


def test_packages_are_in_the_first_prefix_that_has_them(prefixes: list[str]) -> None:
    one, two = prefixes
    assert ament.get_search_paths() == prefixes
    assert ament.get_packages_with_prefixes() == {"foo": one, "bar": one, "baz": two}
    assert ament.get_package_prefix("bar") == one
    assert ament.get_package_share_directory("foo") == f"{one}/share/foo"
    assert ament.get_package_share_path("foo") == Path(one, "share", "foo")
    with pytest.warns(UserWarning, match="does not exist"):
        ament.get_package_share_directory("baz")
    assert ament.get_package_share_directory("baz", print_warning=False) == f"{two}/share/baz"
    with pytest.raises(ament.PackageNotFoundError, match=r"package 'nothing' not found, searching: \['/"):
        ament.get_package_prefix("nothing")
    assert issubclass(ament.PackageNotFoundError, KeyError)
    for name in ("_a", "a b", "a/b", "a.b", "/a"):
        with pytest.raises(ValueError, match="is not a valid package name"):
            ament.get_package_prefix(name)


def test_resources(prefixes: list[str]) -> None:
    one, two = prefixes
    assert ament.get_resource("packages", "bar") == ("bar of one", one)
    assert ament.get_resources("kind_two") == {"bar": two, "baz": two}
    assert ament.get_resources("nothing") == {}
    assert ament.get_resource_types() == {"packages", "kind_one", "kind_two"}
    assert ament.has_resource("packages", "baz") == two
    assert ament.has_resource("packages", "a_folder") is False
    with pytest.raises(LookupError, match="Could not find the resource 'baz' of type 'kind_one'"):
        ament.get_resource("kind_one", "baz")
    for name in ("a/b", "a\\b", "/a", ".."):
        with pytest.raises(ament.InvalidResourceNameError):
            ament.get_resource("packages", name)
        with pytest.raises(ament.InvalidResourceTypeNameError):
            ament.get_resources(name)


def test_without_the_variable_nothing_is_installed(prefixes: list[str], monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delenv("AMENT_PREFIX_PATH")
    with pytest.raises(OSError, match="'AMENT_PREFIX_PATH' is not set or empty"):
        ament.get_search_paths()
    with pytest.raises(ament.PackageNotFoundError, match="AMENT_PREFIX_PATH is not set"):
        ament.get_package_prefix("foo")


SETUP = """
from glob import glob
import os
from setuptools import setup
package_name = 'demo_nodes'
setup(
    name=package_name,
    data_files=[
        ('share/ament_index/resource_index/packages', ['resource/' + package_name]),
        ('share/' + package_name, ['package.xml', 'demo_nodes/parameters/params.yaml', 'missing.yaml']),
        (os.path.join('share', package_name, 'launch'), glob('starts/*.launch.py') + ['more.launch.py']),
        (f'share/{package_name}/../evil', ['package.xml']),
        (unknown(), ['package.xml']),
    ],
)
"""


@pytest.fixture
def source(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A package that nobody has built, with files that its installation would put elsewhere."""
    monkeypatch.chdir(tmp_path)
    monkeypatch.setitem(sys.modules, "__main__", SimpleNamespace())  # type: ignore[arg-type]
    folder = tmp_path / "src" / "demo_nodes"
    for name in ("demo_nodes/parameters/params.yaml", "starts/one.launch.py", "more.launch.py", "launch/old.launch.py"):
        (folder / name).parent.mkdir(parents=True, exist_ok=True)
        (folder / name).write_text(name)
    (folder / "package.xml").write_text("<?xml version='1.0'?><package format='3'><name> demo_nodes </name></package>")
    return folder


def test_a_package_is_found_where_it_is_run_from(
    prefixes: list[str], source: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    assert ament.get_package_share_directory("demo_nodes") == str(source), "beneath the current folder"
    monkeypatch.chdir("/")
    with pytest.raises(ament.PackageNotFoundError):
        ament.get_package_prefix("demo_nodes")
    program: Any = SimpleNamespace(__file__=str(source / "demo_nodes" / "parameters" / "client.py"))
    with monkeypatch.context() as patch:
        patch.setitem(sys.modules, "__main__", program)
        assert ament.get_package_prefix("demo_nodes") == str(source), "above the program"
    monkeypatch.syspath_prepend(source)
    monkeypatch.delenv("AMENT_PREFIX_PATH")
    assert ament.get_package_share_path("demo_nodes") == source, "on Python's path"


def test_what_setup_py_would_install_elsewhere_is_there(prefixes: list[str], source: Path) -> None:
    (source / "setup.py").write_text(SETUP)
    share = ament.get_package_share_path("demo_nodes")
    assert ament.get_package_share_path("demo_nodes") == share != source
    assert (share / "params.yaml").read_text() == "demo_nodes/parameters/params.yaml"
    assert sorted(path.name for path in (share / "launch").iterdir()) == [
        "more.launch.py", "old.launch.py", "one.launch.py",
    ]  # fmt: skip
    assert (share / "package.xml").exists()
    assert not (share.parent / "evil").exists()
    (source / "setup.py").write_text("setup(data_files=[('share/demo_nodes', ['package.xml'])]")
    assert ament.get_package_share_path("demo_nodes") == source, "a setup.py that is no Python says nothing"
    for text in ("-" * 100_000 + "1", "name = " + " + ".join(["'a'"] * 5_000)):
        (source / "setup.py").write_text(text)
        assert ament.get_package_share_path("demo_nodes") == source
