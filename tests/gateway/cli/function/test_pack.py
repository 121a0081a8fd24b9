"""How a function's code is packed, and what its manifest may say."""

from __future__ import annotations

import io
import os
import zipfile
from dataclasses import replace
from pathlib import Path

import pytest

from gateway.cli.function import pack as cli_function_pack
from gateway.cli.function.manifest import handler_of, read_manifest
from gateway.cli.function.pack import Packed, pack
from gateway.cli.rule.file import read_rules
from metaros.automation.functions.package import check_zip
from metaros.errors import UsageError
from metaros.limits import LIMITS


def write(folder: Path, **files: str) -> Path:
    """A folder of files, whose names have `__` for `/` and `_DOT_` for `.`."""
    for name, text in files.items():
        path = folder / name.replace("__", "/").replace("_DOT_", ".")
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(text)
    return folder


def names(packed: Packed) -> list[str]:
    """What is in it."""
    return zipfile.ZipFile(io.BytesIO(packed.data)).namelist()


def test_the_same_code_is_the_same_bytes(tmp_path: Path) -> None:
    one = write(tmp_path / "one", app_DOT_py="a", lib__b_DOT_py="b", lib__a_DOT_py="a")
    two = write(tmp_path / "two", lib__a_DOT_py="a", lib__b_DOT_py="b", app_DOT_py="a")
    os.utime(two / "app.py", (1, 1))
    assert pack(one).data == pack(two).data
    assert names(pack(one)) == ["app.py", "lib/a.py", "lib/b.py"]
    assert check_zip(pack(one).data).files == 3
    (two / "app.py").write_text("b")
    assert pack(one).data != pack(two).data


def test_what_never_belongs_to_code_is_left_out(tmp_path: Path) -> None:
    folder = write(
        tmp_path,
        app_DOT_py="",
        _DOT_env="SECRET=1",
        _DOT_git__config="",
        lib____pycache____a_DOT_pyc="",
        _DOT_venv__bin__python="",
        b_DOT_pyc="",
    )
    packed = pack(folder)
    assert names(packed)[0] == "app.py"
    assert not any(part in name for name in names(packed) for part in (".env", ".git", ".venv", ".pyc"))


@pytest.mark.parametrize(
    ("lines", "kept"),
    [
        ("*.txt", ["app.py", "data/c.json", "data/deep/d.json"]),
        ("/a.txt", ["app.py", "data/b.txt", "data/c.json", "data/deep/d.json"]),
        ("data/", ["a.txt", "app.py"]),
        ("data/*.json", ["a.txt", "app.py", "data/b.txt", "data/deep/d.json"]),
        ("data/**/*.json", ["a.txt", "app.py", "data/b.txt"]),
        ("*.txt\n!b.txt", ["app.py", "data/b.txt", "data/c.json", "data/deep/d.json"]),
        ("# a.txt\n\n?.txt", ["app.py", "data/c.json", "data/deep/d.json"]),
        ("app.py/", ["a.txt", "app.py", "data/b.txt", "data/c.json", "data/deep/d.json"]),
    ],
)
def test_ignored_files_are_left_out_as_in_git(tmp_path: Path, lines: str, kept: list[str]) -> None:
    folder = write(
        tmp_path, app_DOT_py="", a_DOT_txt="", data__b_DOT_txt="", data__c_DOT_json="", data__deep__d_DOT_json=""
    )
    (folder / ".gitignore").write_text(lines)
    assert names(pack(folder)) == kept


def test_links_lead_to_files_within_the_folder(tmp_path: Path) -> None:
    folder = write(tmp_path / "code", app_DOT_py="a")
    (folder / "same.py").symlink_to("app.py")
    assert zipfile.ZipFile(io.BytesIO(pack(folder).data)).read("same.py") == b"a"
    (tmp_path / "secret").write_text("s")
    (folder / "other.py").symlink_to(tmp_path / "secret")
    with pytest.raises(UsageError, match="no file within"):
        pack(folder)
    (folder / "other.py").unlink()
    (folder / "all").symlink_to(tmp_path)
    with pytest.raises(UsageError, match="a link to a folder"):
        pack(folder)


def test_files_and_zip_files_are_code_too(tmp_path: Path) -> None:
    write(tmp_path, clean_DOT_py="def handler(e, c): ...", no_DOT_txt="", bad_DOT_zip="PK?")
    alone = pack(tmp_path / "clean.py")
    assert (names(alone), handler_of(alone, tmp_path)) == (["clean.py"], "clean.handler")
    (tmp_path / "code.zip").write_bytes(alone.data)
    assert pack(tmp_path / "code.zip") == alone
    for name, why in (("no.txt", "neither"), ("bad.zip", "no zip file"), ("none", "there is no"), ("empty", "no file")):
        (tmp_path / "empty").mkdir(exist_ok=True)
        with pytest.raises(UsageError, match=why):
            pack(tmp_path / name)


def test_what_is_too_large_names_its_bound(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    folder = write(tmp_path, app_DOT_py="x" * 2_000_000, b_DOT_py="")
    monkeypatch.setattr(cli_function_pack, "LIMITS", replace(LIMITS, function_unpacked_bytes=1024 * 1024))
    with pytest.raises(UsageError, match=r"has 1\.9 MiB, at most 1 MiB"):
        pack(folder)
    monkeypatch.setattr(cli_function_pack, "LIMITS", replace(LIMITS, function_files=1))
    with pytest.raises(UsageError, match="2 files; code has at most 1"):
        pack(folder)


def test_the_handler_of_code_that_names_none(tmp_path: Path) -> None:
    def found(*modules: str) -> str:
        return handler_of(Packed(data=b"", files=1, left_out=0, modules=modules), tmp_path)

    assert found("a", "app", "lambda_function") == "app.handler"
    assert found("a", "lambda_function") == "lambda_function.lambda_handler"
    assert found("a") == "a.handler"
    with pytest.raises(UsageError, match="--handler"):
        found("a", "b")


@pytest.mark.parametrize(
    ("text", "why"),
    [
        ("name: [", "no YAML"),
        ("- a", "it has fields"),
        ("timeout_s: soon", "timeout_s is seconds"),
        ("memory_mb: 1.5", "memory_mb is a whole number"),
        ("environment: {A: 1}", "environment is names with texts"),
        ("handler: 3", "handler is a text"),
    ],
)
def test_a_manifest_that_cannot_be_is_refused(tmp_path: Path, text: str, why: str) -> None:
    (tmp_path / "function.yaml").write_text(text)
    with pytest.raises(UsageError, match=why):
        read_manifest(tmp_path)


def test_a_manifest_says_what_it_says(tmp_path: Path) -> None:
    assert read_manifest(tmp_path) == {}
    (tmp_path / "function.yaml").write_text("name: a\ntimeout_s: 2.5\ntriggers: [{topic: scan}]\n")
    assert read_manifest(tmp_path) == {"name": "a", "timeout_s": 3}


@pytest.mark.parametrize(
    ("text", "found"),
    [
        ("name: a", ["a"]),
        ('{"name": "a"}', ["a"]),
        ("- name: a\n- name: b\n", ["a", "b"]),
        ("rules: [{name: a}]", ["a"]),
        ("name: a\n---\nrules: [{name: b}]\n---\n", ["a", "b"]),
    ],
)
def test_a_file_holds_one_rule_or_several(tmp_path: Path, text: str, found: list[str]) -> None:
    (tmp_path / "rules.yaml").write_text(text)
    assert [rule["name"] for rule in read_rules(tmp_path / "rules.yaml")] == found


@pytest.mark.parametrize("text", ["", "a", "rules: [", "[1]", "name: 3"])
def test_what_holds_no_rule_is_refused(tmp_path: Path, text: str) -> None:
    (tmp_path / "rules.yaml").write_text(text)
    with pytest.raises(UsageError):
        read_rules(tmp_path / "rules.yaml")
