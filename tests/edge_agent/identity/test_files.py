"""The identity's file: one piece, mode 0600, and either the old or the new one after a failure."""

from __future__ import annotations

import json
import stat
import sys
from dataclasses import replace
from pathlib import Path

import pytest

from edge_agent.errors import IdentityFileError
from edge_agent.identity.files import IdentityFiles, RobotIdentity
from edge_agent.identity.key import key_to_pem, new_key, public_der
from tests.support.servers.fleet_ca import FleetCa


def make_identity(ca: FleetCa | None = None, robot: str = "arm") -> RobotIdentity:
    """An identity as an enrolment leaves it."""
    ca = ca or FleetCa()
    key = new_key()
    return RobotIdentity(
        robot=robot,
        fleet=ca.fleet,
        url="https://localhost:8080",
        system_trust=False,
        grpc_port=8081,
        grpc_tls=True,
        certificate=ca.robot(key.public_key(), robot),
        chain=ca.chain,
        roots=ca.roots,
        key=key_to_pem(key),
    )


def test_what_is_saved_is_loaded(tmp_path: Path) -> None:
    files = IdentityFiles(tmp_path)
    assert files.load() is None
    first, second = make_identity(), make_identity()
    files.save(first)
    assert files.load() == first
    files.save(second)
    assert files.load() == second
    assert "PRIVATE" not in repr(first)


@pytest.mark.skipif(sys.platform == "win32", reason="modes are Unix's")
def test_nobody_else_can_read_the_key(tmp_path: Path) -> None:
    files = IdentityFiles(tmp_path)
    files.save(make_identity())
    files.pending_key("x")
    modes = {path.name: stat.S_IMODE(path.stat().st_mode) for path in files.folder.iterdir()}
    assert modes == {"identity.json": 0o600, "pending.json": 0o600}
    assert stat.S_IMODE(files.folder.stat().st_mode) == 0o700
    (files.folder / "identity.json").chmod(0o640)
    with pytest.raises(IdentityFileError, match="0640"):
        files.load()


def test_a_pending_key_waits_for_its_own_purpose(tmp_path: Path) -> None:
    first = public_der(IdentityFiles(tmp_path).pending_key("token a"))
    assert public_der(IdentityFiles(tmp_path).pending_key("token a")) == first
    assert public_der(IdentityFiles(tmp_path).pending_key("token b")) != first
    IdentityFiles(tmp_path).save(make_identity(), token="token b")
    assert not (tmp_path / "identity" / "pending.json").exists()


@pytest.mark.parametrize("damage", ["half", "list", "key", "certificate", "type"])
def test_a_damaged_file_is_named(tmp_path: Path, damage: str) -> None:
    files = IdentityFiles(tmp_path)
    files.save(make_identity())
    path = files.folder / "identity.json"
    table = json.loads(path.read_text())
    path.write_text(
        {
            "half": path.read_text()[:100],
            "list": "[]",
            "key": json.dumps({**table, "key": "none"}),
            "certificate": json.dumps({**table, "certificate": "none"}),
            "type": json.dumps({**table, "grpc_port": "8081"}),
        }[damage]
    )
    with pytest.raises(IdentityFileError):
        files.load()


def test_a_save_that_fails_leaves_the_old_identity(tmp_path: Path) -> None:
    files = IdentityFiles(tmp_path)
    old = make_identity()
    files.save(old)
    (files.folder / "identity.tmp").mkdir()  # the draft cannot be written
    with pytest.raises(IdentityFileError, match="cannot write"):
        files.save(replace(old, url="https://elsewhere"))
    assert files.load() == old
