"""The shape of the tree: module size, docstrings, exports; the import rule of `make check` has every package."""

from __future__ import annotations

import importlib
import pkgutil

import pytest

from tests.layout.reading import PACKAGES, ROOT, shape, sources

MODULE_LINES = 400
TEST_LINES = 600
FUNCTION_LINES = 60
SHARES_THE_READING = pytest.mark.xdist_group("shape of modules")  # of thousands of files, which is read once a worker


def test_no_module_is_over_the_size_cap() -> None:
    modules = sources(*PACKAGES, "load_tests", "tools", "examples")
    over = {str(p.relative_to(ROOT)): n for p in modules if (n := p.read_text().count("\n")) > MODULE_LINES}
    over |= {str(p.relative_to(ROOT)): n for p in sources("tests") if (n := p.read_text().count("\n")) > TEST_LINES}
    assert over == {}


@SHARES_THE_READING
def test_no_function_is_over_its_cap() -> None:
    over = [
        f"{path.relative_to(ROOT)}:{line} {name} ({lines})"
        for path in sources(*PACKAGES, "load_tests", "tools")
        for line, name, lines in shape(path).functions
        if lines > FUNCTION_LINES
    ]
    assert over == []


@SHARES_THE_READING
def test_every_module_and_public_name_has_a_docstring() -> None:
    assert [name for path in sources(*PACKAGES) for name in shape(path).bare] == []


def module_names() -> list[str]:
    """Dotted names of every module of ours, generated ones excepted."""
    names = []
    for package in PACKAGES:
        found = pkgutil.walk_packages([str(ROOT / package)], prefix=f"{package}.")
        names += [m.name for m in found if "._proto" not in m.name and not m.name.endswith("__main__")]
    return names


@pytest.mark.parametrize("package", PACKAGES)
def test_exports_exist(package: str) -> None:
    broken = []
    for name in module_names():
        if name.split(".")[0] != package or name.startswith("metaros.interfaces."):
            continue
        module = importlib.import_module(name)
        exported = getattr(module, "__all__", [])
        broken += [f"{name}.{item}" for item in exported if not hasattr(module, item)]
        if len(set(exported)) != len(exported):
            broken.append(f"{name}.__all__ names something twice")
    assert broken == []


def test_every_package_is_in_the_import_rule() -> None:
    rule = (ROOT / ".importlinter").read_text()
    folders = [f"metaros.{p.parent.name}" for p in (ROOT / "metaros").glob("*/__init__.py")]
    folders += [f"gateway.{p.parent.name}" for p in (ROOT / "gateway").glob("*/__init__.py")]
    missing = [name for name in folders if f"    {name}\n" not in rule]
    assert missing == []
