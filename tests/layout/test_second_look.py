"""The second look at tests that failed: only a few, only what failed, and what fails again stays failed."""

from __future__ import annotations

import importlib.util
import json
from pathlib import Path
from types import ModuleType

import pytest

ROOT = Path(__file__).resolve().parents[2]


@pytest.fixture
def second_look() -> ModuleType:
    spec = importlib.util.spec_from_file_location("second_look_under_test", ROOT / "tools" / "second_look.py")
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


TESTS = """
import pytest

def test_good(): pass
def test_bad(): assert False

@pytest.mark.parametrize("number", range(9))
def test_many(number): pass
"""


def project(root: Path, failed: list[str]) -> Path:
    """A folder with a few tests, whose last run ended as `failed` says."""
    (root / "pyproject.toml").write_text("[tool.pytest.ini_options]\n")
    (root / "test_it.py").write_text(TESTS)
    cache = root / ".pytest_cache" / "v" / "cache"
    cache.mkdir(parents=True)
    (cache / "lastfailed").write_text(json.dumps(dict.fromkeys(failed, True)))
    return root


@pytest.mark.parametrize(
    ("failed", "code"),
    [
        ([f"test_it.py::test_many[{number}]" for number in range(8)], 0),
        (["test_it.py::test_good", "test_it.py::test_bad"], 1),
        ([f"test_it.py::test_many[{number}]" for number in range(9)], 1),
        (["test_it.py"], 1),
        ([], 1),
    ],
    ids=["pass alone", "one fails again", "too many", "a module that could not be read", "none failed"],
)
def test_only_what_passes_alone_is_forgiven(
    second_look: ModuleType, tmp_path: Path, capfd: pytest.CaptureFixture[str], failed: list[str], code: int
) -> None:
    assert second_look.main(project(tmp_path, failed)) == code
    assert ("UNSTEADY" in capfd.readouterr().out) == (code == 0)


def test_no_run_is_no_success(second_look: ModuleType, tmp_path: Path) -> None:
    assert second_look.main(tmp_path) == 1
