"""docs/reference/interfaces.md: its examples run and its list of packages is whole."""

from __future__ import annotations

import re
from pathlib import Path

from metaros.cdr.layout import MAX_DEPTH, MAX_INLINED_FIELDS
from metaros.cdr.paths import MAX_PATHS
from metaros.idl import ServiceDefinition, default_catalogue
from metaros.idl.catalogue import shipped_names
from metaros.idl.parser import MAX_FIXED, MAX_TEXT_CHARS
from tests.support.tables import cases

PAGE = (Path(__file__).resolve().parents[3] / "docs" / "reference" / "interfaces.md").read_text(encoding="utf-8")


@cases("example", re.findall(r"```python\n(.*?)```", PAGE, re.DOTALL))
def test_examples_run(example: str) -> None:
    exec(compile(example, "interfaces.md", "exec"), {"__name__": "example"})


def test_every_package_is_listed() -> None:
    packages = {name.split("/")[0] for name in shipped_names()}
    assert {package for package in packages if f"`{package}`" not in PAGE} == set()


def test_every_type_of_our_own_is_described() -> None:
    catalogue = default_catalogue()
    for name in shipped_names():
        if name.startswith("metaros_msgs/"):
            (row,) = [line for line in PAGE.splitlines() if line.startswith(f"| `{name.split('/')[2]}`")]
            definition = catalogue.get(name)
            parts = (
                [definition.request, definition.response] if isinstance(definition, ServiceDefinition) else [definition]
            )
            assert all(f"`{field.name}" in row for part in parts for field in part.fields)


def test_bounds_are_as_described() -> None:
    assert (MAX_TEXT_CHARS, MAX_FIXED, MAX_DEPTH, MAX_INLINED_FIELDS, MAX_PATHS) == (10**6, 2**24, 32, 20_000, 1024)
