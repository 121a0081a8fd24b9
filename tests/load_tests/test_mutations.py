"""The faults that suites are compared against: the list, and that a tree is always as before."""

from __future__ import annotations

import subprocess
from collections import Counter
from pathlib import Path

import pytest

from load_tests.mutations.closeness import mirror_rank
from load_tests.mutations.faults import KINDS, Mutation, TreeError, line_of, mutated, read_mutations
from load_tests.mutations.select import lines_of

FAULT = Mutation(id="m1", file="bound.py", old="a < b", new="a <= b", kind="limit", why="one too many")
SOURCE = "def fits(a, b):\n    return (\n        a < b\n    )\n"


@pytest.fixture
def tree(tmp_path: Path) -> Path:
    """A clone with one file."""
    (tmp_path / "bound.py").write_text(SOURCE)
    who = ("-c", "user.name=t", "-c", "user.email=t@example.com")
    for command in (("init", "-q"), ("add", "."), (*who, "commit", "-qm", "all")):
        subprocess.run(["git", *command], cwd=tmp_path, check=True)
    return tmp_path


def test_the_list_is_well_formed() -> None:
    faults = read_mutations()
    assert len({fault.id for fault in faults}) == len(faults) >= 60
    assert [fault for fault in faults if fault.old == fault.new or "\n" in fault.old + fault.new or not fault.why] == []
    kinds = Counter(fault.kind for fault in faults)
    assert kinds.keys() == set(KINDS)
    assert kinds.total() - kinds["logic"] >= len(faults) / 3
    packages = Counter(fault.package for fault in faults)
    least = {"metaros": 20, "edge_agent": 10, "gateway": 20, "dashboard": 6, "deploy": 1}
    assert {name: packages[name] for name, count in least.items() if packages[name] < count} == {}


def test_a_fault_is_there_for_a_while_and_gone_after_an_exception(tree: Path) -> None:
    path = tree / "bound.py"
    before = path.stat().st_mtime_ns
    meanwhile: list[tuple[str, int]] = []

    def broken_off() -> None:
        with mutated(FAULT, tree):
            meanwhile.append((path.read_text(), int(path.stat().st_mtime)))
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        broken_off()
    [(text, at_s)] = meanwhile
    assert "a <= b" in text
    assert at_s != before // 10**9  # or a .pyc of before would be taken for this one's
    assert path.read_text() == SOURCE
    assert path.stat().st_mtime_ns == before


def test_a_file_that_somebody_changed_is_refused(tree: Path) -> None:
    path = tree / "bound.py"
    path.write_text(SOURCE + "# mine\n")
    with pytest.raises(TreeError, match="not as it was committed"), mutated(FAULT, tree):
        pass
    assert path.read_text() == SOURCE + "# mine\n"


@pytest.mark.parametrize("source", [SOURCE * 2, "def fits(a, b):\n    return b > a\n"])
def test_code_that_has_moved_on_is_reported(tree: Path, source: str) -> None:
    (tree / "bound.py").write_text(source)
    with pytest.raises(TreeError, match="moved on"):
        line_of(FAULT, tree)


def test_a_fault_is_reached_where_its_statement_is(tree: Path) -> None:
    assert line_of(FAULT, tree) == 3
    assert lines_of(SOURCE, 3) == range(2, 5)
    assert lines_of("LIMIT = 3\n", 1) is None


def test_the_nearest_tests_are_a_modules_own() -> None:
    ranks = [
        mirror_rank("gateway/automation/queue/backoff.py", test)
        for test in (
            "tests/gateway/automation/queue/test_backoff.py",
            "tests/gateway/automation/queue/test_accept.py",
            "tests/e2e/app/test_up.py",
        )
    ]
    assert ranks == [0, 1, 2]
