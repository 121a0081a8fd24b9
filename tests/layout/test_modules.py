"""The shape of the tree: module size, docstrings, exports; the import rule of `make check` has every package."""

from __future__ import annotations

import ast
import importlib
import pkgutil
import subprocess
import sys
from pathlib import Path

import pytest

from tests.layout.reading import PACKAGES, ROOT, functions, may_be_longer, sources

MODULE_LINES = 400
TEST_LINES = 600
FUNCTION_LINES = 60
DOCSTRINGS = "D100,D101,D103,D104"  # of modules, classes, functions and packages that are public


def test_no_module_is_over_the_size_cap() -> None:
    modules = sources(*PACKAGES, "load_tests", "tools", "examples")
    over = {str(p.relative_to(ROOT)): n for p in modules if (n := p.read_text().count("\n")) > MODULE_LINES}
    over |= {str(p.relative_to(ROOT)): n for p in sources("tests") if (n := p.read_text().count("\n")) > TEST_LINES}
    assert over == {}


def test_no_function_is_over_its_cap(tmp_path: Path) -> None:
    modules = [path for path in sources(*PACKAGES, "load_tests", "tools") if may_be_longer(path, FUNCTION_LINES)]
    over = [
        f"{path.relative_to(ROOT)}:{line} {name} ({lines})"
        for path in modules
        for line, name, lines in functions(ast.parse(path.read_text()))
        if lines > FUNCTION_LINES
    ]
    assert over == []
    body = "".join(f"        x = {number}\n" for number in range(FUNCTION_LINES))
    (tmp_path / "planted.py").write_text(f"class A:\n    @property\n    def f(self):\n{body}")
    assert may_be_longer(tmp_path / "planted.py", FUNCTION_LINES)
    assert list(functions(ast.parse((tmp_path / "planted.py").read_text()))) == [(3, "f", FUNCTION_LINES + 1)]


def test_every_module_and_public_name_has_a_docstring(tmp_path: Path) -> None:
    """One module has faults, and they are all that is found; private modules, which ruff leaves alone, are not ours."""
    assert [path for path in sources(*PACKAGES) if path.stem.startswith("_") and not path.stem.endswith("__")] == []
    (tmp_path / "planted.py").write_text("class A: ...\n\n\ndef f() -> int:\n    return 1\n")
    ruff = str(Path(sys.executable).with_name("ruff"))
    flags = ["--isolated", "--no-cache", "--output-format", "concise", "--exclude", "_proto", "--select", DOCSTRINGS]
    asked = [ruff, "check", *flags, str(tmp_path / "planted.py"), *PACKAGES]
    found = subprocess.run(asked, cwd=ROOT, capture_output=True, text=True).stdout.splitlines()
    named = [line for line in found if ": D" in line]
    assert [line.split(": ")[1].split()[0] for line in named if "planted.py:" in line] == ["D100", "D101", "D103"], (
        found
    )
    assert [line for line in named if "planted.py:" not in line] == []


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
