"""Starts of programs, of this tree and of another one."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest

from load_tests.benchmarks.library.start import FLOOR, HERE, Tree, main, wait_for


def test_trees_take_turns_and_a_program_takes_longer_than_nothing(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["--rounds", "1", "--only", "metaros --help", "--tree", str(HERE)]) == 0
    _, *rows, foot = capsys.readouterr().out.splitlines()
    assert [row[:22].strip() for row in rows] == [FLOOR, FLOOR, "metaros --help", "metaros --help"]
    assert [float(row.split()[-1]) > 1 for row in rows] == [False, False, True, True]
    assert "1 interleaved rounds" in foot


def test_a_program_that_does_not_start_is_reported(tmp_path: Path) -> None:
    tree = Tree(tmp_path)
    process = subprocess.Popen(["false"])
    with pytest.raises(RuntimeError, match="false did not start"):
        wait_for(process, lambda: False)
    assert tree.python == sys.executable
