"""Gateways by name: the noun, and which gateway commands ask then."""

from __future__ import annotations

import io
import json
from pathlib import Path

import pytest

from metaros.access import contexts
from metaros.cli.main import main
from metaros.cli.shared.gateway_http import open_gateway

KEY = "mrk_abc_def"


@pytest.fixture(autouse=True)
def home(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A home of one's own."""
    monkeypatch.setenv("HOME", str(tmp_path))
    monkeypatch.setenv("METAROS_RUNTIME_DIR", str(tmp_path / "run"))
    for name in ("METAROS_CONTEXT", "METAROS_GATEWAY_URL", "METAROS_KEY"):
        monkeypatch.delenv(name, raising=False)
    return tmp_path


def metaros(*words: str) -> int:
    """A command; its exit code."""
    with pytest.raises(SystemExit) as ended:
        main(words)
    return int(ended.value.code or 0)


def test_the_first_is_asked_until_another_one_is_used(capsys: pytest.CaptureFixture[str]) -> None:
    assert metaros("context", "add", "lab", "--gateway", "http://10.0.0.1:8080") == 0
    assert metaros("context", "add", "fleet", "--gateway", "https://fleet.example") == 0
    assert open_gateway("").url == "http://10.0.0.1:8080"
    assert metaros("context", "use", "fleet") == 0
    assert open_gateway("").url == "https://fleet.example"
    assert open_gateway("http://127.0.0.1:1").url == "http://127.0.0.1:1", "what is said wins"
    capsys.readouterr()
    assert metaros("context", "list", "-o", "json") == 0
    rows = json.loads(capsys.readouterr().out)
    assert [(row["name"], row["current"]) for row in rows] == [("fleet", True), ("lab", False)]
    assert metaros("context", "remove", "fleet") == 0
    assert contexts.current_gateway() == ""


def test_one_command_can_ask_another(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> None:
    monkeypatch.setenv("METAROS_CONTEXT", "")  # so that it is put back
    for name in ("a", "b"):
        metaros("context", "add", name, "--gateway", f"http://{name}.example")
    capsys.readouterr()
    assert metaros("--context", "b", "context", "show") == 0
    assert capsys.readouterr().out.strip() == "http://b.example"


def test_a_key_is_kept_with_its_gateway(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> None:
    monkeypatch.setattr("sys.stdin", io.StringIO(f"{KEY}\n"))
    assert metaros("context", "add", "lab", "--gateway", "https://lab.example", "--key") == 0
    assert open_gateway("").identity == {"Authorization": f"Bearer {KEY}"}
    assert KEY not in contexts.contexts_file().read_text()
    assert KEY not in capsys.readouterr().err
    monkeypatch.setattr("sys.stdin", io.StringIO("hunter2\n"))
    assert metaros("context", "add", "lab", "--gateway", "https://lab.example", "--key") == 2


@pytest.mark.parametrize(
    ("words", "told"),
    [
        (("use", "nobody"), "known: lab"),
        (("add", ".x", "--gateway", "http://a"), "letters"),
        (("add", "x", "--gateway", "ftp://a"), "not the address"),
        (("add", "x", "--gateway", "http://a", "--ca", "root.pem"), "--key"),
    ],
)
def test_what_is_wrong_is_said(words: tuple[str, ...], told: str, capsys: pytest.CaptureFixture[str]) -> None:
    metaros("context", "add", "lab", "--gateway", "http://lab.example")
    before = contexts.contexts_file().read_text()
    assert metaros("context", *words) == 2
    assert told in capsys.readouterr().err
    assert contexts.contexts_file().read_text() == before
