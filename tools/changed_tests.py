"""Run the tests that the change since the last commit on main can break, the closest first: `make test CHANGED=1`.

A test is close to a changed module when it mirrors its path, imports it, or imports what imports it; the import graph
says so, in which a package's re-export is no step. Tests run in that order until the seconds are spent; what is left is
said, and is CI's. The closest ones always run to their end. A change of the dashboard runs its own checks, too.
"""

from __future__ import annotations

import argparse
import os
import re
import subprocess
import sys
import time
from collections.abc import Iterable
from pathlib import Path

import grimp
import pytest

__all__ = ["Graph", "changed_files", "imported_by", "main", "module_name", "rank"]

ROOT = Path(__file__).resolve().parent.parent
PACKAGES = ("metaros", "edge_agent", "gateway")
ALWAYS = ("tests/layout/test_modules.py", "tests/layout/test_repository.py")
# What has no place in the import graph: files that begin so are looked after by tests in these places.
FOLDERS = {
    "deploy/": ("tests/deploy",),
    "docs/": ("tests/docs", "tests/layout/test_docs.py"),
    "README.md": ("tests/layout/test_docs.py",),
    "examples/": ("tests/examples",),
    "proto/": ("tests/metaros/link",),
}
FURTHEST = 4  # steps in the import graph; beyond that everything imports everything
SECONDS = 45.0
VARIABLE = "METAROS_CLOSEST"
# An import, wherever in a file: a tenth of a parser's time, which is felt in a thousand files.
IMPORT = re.compile(
    r"^[ \t]*(?:from[ \t]+([\w.]+)[ \t]+import[ \t]+(?:\(([^)]*)\)|([^\n(]+))|import[ \t]+([^\n]+))", re.MULTILINE
)
COMMENT = re.compile(r"#[^\n]*")


def changed_files(root: Path) -> list[str]:
    """Files that differ from where this branch left main, new ones included."""

    def git(*arguments: str) -> list[str]:
        done = subprocess.run(["git", *arguments], cwd=root, capture_output=True, text=True, check=True)
        return done.stdout.split("\0") if "-z" in arguments else [done.stdout.strip()]

    base = git("merge-base", "HEAD", "main")[0]
    found = git("diff", "--name-only", "-z", base) + git("ls-files", "--others", "--exclude-standard", "-z")
    return sorted({name for name in found if name})


def module_name(path: str) -> str:
    """`gateway/api/__init__.py` is `gateway.api`."""
    return path.removesuffix(".py").removesuffix("/__init__").replace("/", ".")


class Graph:
    """Who imports whom, in the packages and in the tests."""

    def __init__(self, root: Path) -> None:
        self.importers: dict[str, set[str]] = {}
        built = grimp.build_graph(*PACKAGES, cache_dir=None)
        for module in built.modules:
            self.importers[module] = set(built.find_modules_that_directly_import(module))
        self.tests: dict[str, str] = {}
        for path in sorted((root / "tests").rglob("*.py")):
            name = str(path.relative_to(root))
            self.tests[module_name(name)] = name
        for module, name in self.tests.items():
            for imported in imported_by((root / name).read_text()):
                self._add(imported, module)
        self._packages = {name.rpartition(".")[0] for name in self.importers}

    def _add(self, imported: str, by: str) -> None:
        while imported not in self.importers and imported not in self.tests and "." in imported:
            imported = imported.rpartition(".")[0]  # a name in a module, not a module
        self.importers.setdefault(imported, set()).add(by)

    def distances(self, module: str) -> dict[str, int]:
        """Test files by their steps to a module, `FURTHEST` at most."""
        steps = {module: 0}
        waiting = [module]
        while waiting:
            reached = waiting.pop(0)
            onward = steps[reached] + (0 if reached in self._packages and reached != module else 1)
            for importer in sorted(self.importers.get(reached, ())):
                if onward <= FURTHEST and onward < steps.get(importer, FURTHEST + 1):
                    steps[importer] = onward
                    waiting.append(importer)
        return {self.tests[name]: count for name, count in steps.items() if name in self.tests}


def imported_by(text: str) -> Iterable[str]:
    """Dotted names that a file imports; `from a import b` is `a.b`."""
    for module, several, few, plain in IMPORT.findall(text):
        for name in COMMENT.sub("", several or few or plain).split(","):
            if words := name.split():
                yield f"{module}.{words[0]}" if module else words[0]


def rank(changed: Iterable[str], graph: Graph) -> list[tuple[int, str]]:
    """Test files with how far they are from the change, the closest first; 0: it is their very subject."""
    found: dict[str, int] = dict.fromkeys(ALWAYS, 1)

    def add(test: str, steps: int) -> None:
        found[test] = min(steps, found.get(test, FURTHEST))

    for name in changed:
        for beginning, places in FOLDERS.items():
            if name.startswith(beginning):
                for test in (test for test in graph.tests.values() if test.startswith(places)):
                    add(test, 1)
        if not name.endswith(".py"):
            continue
        mirror = f"tests/{name.removesuffix('.py')}".rpartition("/")
        for test, steps in graph.distances(module_name(name)).items():
            add(test, max(1, steps - test.startswith(f"{mirror[0]}/")))
        for test in graph.tests.values():
            if test == name or test.startswith(f"{mirror[0]}/test_{mirror[2]}"):
                add(test, 0)
            if mirror[2] == "__init__" and test.rpartition("/")[0] == mirror[0]:
                add(test, 1)  # whatever imports a module of the package runs it
    return sorted((steps, test) for test, steps in found.items() if "/test_" in test)


class Closest:
    """Stops beginning tests once the seconds are spent, but for the first so many files."""

    def __init__(self, seconds: float, always: set[str]) -> None:
        self._until_s = time.monotonic() + seconds
        self._always = always

    @pytest.hookimpl(tryfirst=True)
    def pytest_runtest_setup(self, item: pytest.Item) -> None:
        """Leave the rest to CI."""
        if time.monotonic() > self._until_s and item.nodeid.partition("::")[0] not in self._always:
            pytest.skip("left to CI: the seconds are spent")


def pytest_configure(config: pytest.Config) -> None:
    """As a plugin of the run that `main` starts."""
    seconds, *always = os.environ[VARIABLE].split(os.pathsep)
    config.pluginmanager.register(Closest(float(seconds), set(always)))


def main(arguments: list[str]) -> int:
    """Choose and run; further arguments are pytest's."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--seconds", type=float, default=SECONDS, help="how long tests may begin to run")
    parser.add_argument("--list", action="store_true", help="print the choice, run nothing")
    options, further = parser.parse_known_args(arguments)
    changed = changed_files(ROOT)
    if not changed:
        print("metaros: nothing has changed since main")
        return 0
    ranked = rank(changed, Graph(ROOT))
    print(f"metaros: {len(changed)} changed files, {len(ranked)} test files, the closest first", flush=True)
    if options.list:
        print("\n".join(f"{steps} {test}" for steps, test in ranked))
        return 0
    dashboard = any(name.startswith("dashboard/") for name in changed)
    if dashboard and subprocess.run([sys.executable, "tools/dashboard.py", "check"], cwd=ROOT, check=False).returncode:
        return 1
    closest = [test for steps, test in ranked if steps == 0]
    environ = {**os.environ, VARIABLE: os.pathsep.join([str(options.seconds), *closest])}
    command = [sys.executable, "-m", "pytest", "-p", "tools.changed_tests", *further]
    return subprocess.run([*command, *(test for _, test in ranked)], cwd=ROOT, env=environ, check=False).returncode


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
