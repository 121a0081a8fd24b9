"""`make check`: each check is run and heard, and one that fails is enough."""

from __future__ import annotations

import shlex
from pathlib import Path

import pytest

from tools import check

ROOT = Path(__file__).resolve().parents[2]


def test_one_failure_is_enough_and_hides_no_other(
    capfd: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(check, "CHECKS", ("python -c print(12)", "python -c exit('no')", "python -c print(34)"))
    assert check.main() == 1
    said = capfd.readouterr().out
    assert sorted(line for line in said.splitlines() if "python" not in line) == ["12", "34", "no"]
    assert "python -c exit('no') (" in said
    assert said.count("FAILED with 1") == 1
    monkeypatch.setattr(check, "CHECKS", ("python -c print(12)",))
    assert check.main() == 0


def test_every_generator_has_its_check_and_every_script_is_there() -> None:
    scripts = [shlex.split(command)[1] for command in check.CHECKS if command.startswith("python ")]
    assert [script for script in scripts if not (ROOT / script).is_file()] == []
    generators = {str(path.relative_to(ROOT)) for path in (ROOT / "tools").glob("gen_*.py")}
    assert {path for path in generators if "--check" in (ROOT / path).read_text()} <= set(scripts)
