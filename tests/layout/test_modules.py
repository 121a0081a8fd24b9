"""The shape of the tree: module size, docstrings, exports, and what each package may import."""

from __future__ import annotations

import ast
import importlib
import pkgutil
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
PACKAGES = ("metaros", "edge_agent", "gateway")
MODULE_LINES = 400
TEST_LINES = 600
FUNCTION_LINES = 60


def sources(*folders: str) -> list[Path]:
    """Every Python file we wrote under the given folders."""
    return sorted(
        path
        for folder in folders
        for path in (ROOT / folder).rglob("*.py")
        if "_proto" not in path.parts and "node_modules" not in path.parts
    )


def relative(paths: list[Path]) -> list[str]:
    """Names for readable failures."""
    return [str(path.relative_to(ROOT)) for path in paths]


def test_no_module_is_over_the_size_cap() -> None:
    modules = sources(*PACKAGES, "load_tests", "tools", "examples")
    over = {str(p.relative_to(ROOT)): n for p in modules if (n := p.read_text().count("\n")) > MODULE_LINES}
    over |= {str(p.relative_to(ROOT)): n for p in sources("tests") if (n := p.read_text().count("\n")) > TEST_LINES}
    assert over == {}


def test_no_function_is_over_its_cap() -> None:
    over = []
    for path in sources(*PACKAGES, "load_tests", "tools"):
        for node in ast.walk(ast.parse(path.read_text())):
            if isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef):
                lines = (node.end_lineno or node.lineno) - node.lineno + 1
                if lines > FUNCTION_LINES:
                    over.append(f"{path.relative_to(ROOT)}:{node.lineno} {node.name} ({lines})")
    assert over == []


def test_every_module_and_public_name_has_a_docstring() -> None:
    bare = []
    for path in sources(*PACKAGES):
        tree = ast.parse(path.read_text())
        if tree.body and ast.get_docstring(tree) is None:
            bare.append(str(path.relative_to(ROOT)))
        for node in tree.body:
            named = isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef | ast.ClassDef)
            if named and not node.name.startswith("_") and ast.get_docstring(node) is None:
                bare.append(f"{path.relative_to(ROOT)}:{node.lineno} {node.name}")
    assert bare == []


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


def test_import_rule_holds() -> None:
    lint = Path(sys.executable).with_name("lint-imports")
    done = subprocess.run([lint, "--no-cache"], cwd=ROOT, capture_output=True, text=True)
    assert done.returncode == 0, done.stdout[-4000:]


def test_every_package_is_in_the_import_rule() -> None:
    rule = (ROOT / ".importlinter").read_text()
    folders = [f"metaros.{p.parent.name}" for p in (ROOT / "metaros").glob("*/__init__.py")]
    folders += [f"gateway.{p.parent.name}" for p in (ROOT / "gateway").glob("*/__init__.py")]
    missing = [name for name in folders if f"    {name}\n" not in rule]
    assert missing == []
