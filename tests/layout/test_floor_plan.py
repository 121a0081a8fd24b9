"""The floor plan: how many modules stand side by side, no circles of imports, and an import rule of one screen."""

from __future__ import annotations

from collections import Counter
from collections.abc import Collection, Iterable, Mapping
from configparser import ConfigParser
from graphlib import CycleError, TopologicalSorter
from pathlib import PurePosixPath

import grimp

from tests.layout.reading import PACKAGES, ROOT, tracked

TOP_FLOOR = {"gateway": 8, "edge_agent": 10}
SIDE_BY_SIDE = 25
RULE_BYTES = 4096


def modules_by_folder(files: Iterable[str]) -> Counter[str]:
    """How many Python and TypeScript modules stand in each folder; generated ones and `__init__` do not count."""
    modules = [PurePosixPath(name) for name in files if name.endswith((".py", ".ts", ".tsx"))]
    return Counter(str(path.parent) for path in modules if path.stem != "__init__" and "_proto" not in path.parts)


def circles(imports: Mapping[str, Collection[str]]) -> list[str]:
    """The modules of each circle, as `a -> b -> a`."""
    left = {module: sorted(imports[module]) for module in sorted(imports)}
    found = []
    while True:
        try:
            TopologicalSorter(left).prepare()
            return found
        except CycleError as error:
            circle = error.args[1][::-1]
            found.append(" -> ".join(circle))
            left[circle[0]].remove(circle[1])  # it has been seen; there may be more


def test_the_top_floors_are_small() -> None:
    found = modules_by_folder(tracked())
    assert {package: found[package] for package, most in TOP_FLOOR.items() if not 0 < found[package] <= most} == {}


def test_no_folder_is_crowded() -> None:
    found = modules_by_folder(tracked())
    assert {folder: count for folder, count in found.items() if count > SIDE_BY_SIDE} == {}
    assert {"dashboard/src", "load_tests", "tests/layout", "tools"} < set(found)


def test_no_modules_import_each_other() -> None:
    graph = grimp.build_graph(*PACKAGES, "load_tests", cache_dir=None, exclude_type_checking_imports=False)
    imports = {module: graph.find_modules_directly_imported_by(module) for module in graph.modules}
    found = circles(imports)
    assert not found, "\n".join(found)
    assert circles({"a": {"b"}, "b": {"c"}, "c": {"b"}, "d": {"a", "d"}}) == ["d -> d", "b -> c -> b"]


def test_the_import_rule_fits_on_a_screen_and_has_every_package() -> None:
    assert (ROOT / ".importlinter").stat().st_size <= RULE_BYTES
    rules = ConfigParser()
    rules.read(ROOT / ".importlinter")
    assert rules["importlinter"]["exclude_type_checking_imports"] == "False"
    layered = [rule for rule in rules.values() if rule.get("type") == "layers" and rule.getboolean("exhaustive")]
    assert {name for rule in layered for name in rule["containers"].split()} >= set(PACKAGES)
