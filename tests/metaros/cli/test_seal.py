"""`metaros seal`: keys are made once, rotated, and never shown."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from metaros.cli.main import main
from metaros.seal import Keyring


def run(arguments: list[str]) -> int:
    """The command's exit code."""
    with pytest.raises(SystemExit) as ended:
        main(arguments)
    return int(ended.value.code or 0)


def test_new_list_and_rotate(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = tmp_path / "robot.keys"
    assert run(["seal", "key", "new", str(path), "-o", "json"]) == 0
    first = json.loads(capsys.readouterr().out)["id"]
    assert run(["seal", "key", "rotate", str(path)]) == 0
    ring = Keyring.load(path)
    assert capsys.readouterr().out == f"{path}: key {ring.current.key_id.hex()} seals\n"
    assert run(["seal", "key", "list", str(path), "-o", "json"]) == 0
    printed = capsys.readouterr().out
    rows = [(row["id"], row["use"]) for row in json.loads(printed)]
    assert rows == [(ring.current.key_id.hex(), "seals"), (first, "opens")]
    secrets = [key["secret"] for key in json.loads(path.read_text())["keys"]]
    assert [secret for secret in secrets if secret in printed] == []
    assert run(["seal", "key", "rotate", str(path), "--keep", "0"]) == 0
    assert len(Keyring.load(path).keys) == 1


def test_a_keyring_is_not_overwritten_and_a_missing_one_is_said(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path = tmp_path / "robot.keys"
    assert run(["seal", "key", "new", str(path)]) == 0
    before = path.read_bytes()
    assert run(["seal", "key", "new", str(path)]) == 2
    assert "is there already" in capsys.readouterr().err
    assert path.read_bytes() == before
    assert run(["seal", "key", "rotate", str(tmp_path / "none")]) == 2
    assert "metaros seal key new" in capsys.readouterr().err
