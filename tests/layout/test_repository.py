"""What must never be in the repository: registry hosts, built assets, machine paths, unfinished marks."""

from __future__ import annotations

import json
import re

from tests.layout.reading import ROOT, tracked


def test_lock_has_hashes_and_no_urls() -> None:
    lock = (ROOT / "requirements.lock").read_text()
    assert "://" not in lock
    assert "--hash=sha256:" in lock


def test_npm_lock_names_no_registry() -> None:
    packages = json.loads((ROOT / "dashboard" / "package-lock.json").read_text())["packages"]
    assert [name for name, entry in packages.items() if "resolved" in entry and "://" in entry["resolved"]] == []
    assert all("integrity" in entry for name, entry in packages.items() if name and not entry.get("link"))


def test_lock_covers_what_pyproject_asks() -> None:
    import tomllib

    project = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]
    asked = [*project["dependencies"], *(d for extra in project["optional-dependencies"].values() for d in extra)]
    names = {re.split(r"[\[<>=;~! ]", d)[0].lower().replace("_", "-") for d in asked} - {"metaros"}
    lock = {line.split("==")[0] for line in (ROOT / "requirements.lock").read_text().splitlines() if "==" in line}
    assert names - lock == set()


def test_no_machine_paths_or_built_assets_are_tracked() -> None:
    files = tracked()
    assert [
        name for name in files if name.startswith(("gateway/static/", "dashboard/dist/", "dashboard/node_modules/"))
    ] == []
    assert "uv.lock" not in files
    home = "/wo" + "rk/"
    binary = (".png", ".jpg", ".ico", ".bz2", ".woff2")
    texts = {name: (ROOT / name).read_text(errors="replace") for name in files if not name.endswith(binary)}
    assert [name for name, text in texts.items() if home in text] == []


def test_no_unfinished_marks() -> None:
    marks = re.compile(r"\b(?:TODO|FIXME|XXX|HACK)\b")
    ours = (".py", ".ts", ".tsx", ".css", ".sh", ".proto", ".toml")
    found = [
        f"{name}:{text[: mark.start()].count(chr(10)) + 1}"
        for name in tracked()
        if name.endswith(ours) and name != "tests/layout/test_repository.py"
        for text in [(ROOT / name).read_text()]
        for mark in marks.finditer(text)
    ]
    assert found == []
