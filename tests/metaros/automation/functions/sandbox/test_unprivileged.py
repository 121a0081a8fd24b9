"""The same where the gateway is no root: a user namespace at L3, Landlock at L2, and one user for all at L1."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest

from metaros.automation.functions.program import shown_paths
from metaros.automation.functions.sandbox.level import Level
from metaros.automation.functions.sandbox.mounts import open_way
from tests.support.functions.sandboxed_worker import LEVELS

ROOT = Path(__file__).resolve().parents[5]
USER = 65534
pytestmark = pytest.mark.skipif(sys.platform != "linux" or os.geteuid() != 0, reason="becoming another user needs root")


def become_user(folder: Path) -> None:
    """In the child: see the interpreter, which may lie in /root, and be nobody."""
    open_way([*shown_paths(), str(ROOT), str(folder)])
    os.setgroups([])
    os.setresgid(USER, USER, USER)
    os.setresuid(USER, USER, USER)


@pytest.mark.integration
def test_levels_without_root(tmp_path: Path) -> None:
    os.chown(tmp_path, USER, USER)
    levels = [str(int(level)) for level in LEVELS]
    done = subprocess.run(
        [sys.executable, "-m", "tests.support.gateways.plain_gateway", str(tmp_path), *levels],
        cwd=ROOT,
        capture_output=True,
        text=True,
        preexec_fn=lambda: become_user(tmp_path),
        env={**os.environ, "GATEWAY_SECRET": "s3cret"},
    )
    assert done.returncode == 0, done.stderr[-3000:]
    found = json.loads(done.stdout)
    assert list(found) == [level.name for level in LEVELS]
    for level in LEVELS:
        check(level, found[level.name])


def check(level: Level, found: dict[str, Any]) -> None:
    """What a worker found at that level."""
    assert found["probe"] == "ok"
    assert found["uids"] == [USER] * 3
    assert found["caps"] == [0] * 6
    assert found["answer"] == 42
    assert found["memory"] == "MemoryError"
    assert 1 <= found["children"] <= 16
    refused = {"EACCES", "EPERM", "ENOENT", "ESRCH", "ECONNREFUSED"}
    kept_from = {name: found[name] for name in ("secret", "environ", "victim_tmp", "kill", "kill_victim", "tcp")}
    if level is Level.L1:  # it is the gateway's own user, and nothing else keeps them apart
        assert kept_from["secret"] == "s3cret"
        assert "GATEWAY_SECRET=s3cret" in kept_from["environ"]
        assert (kept_from["kill"], kept_from["kill_victim"], kept_from["tcp"]) == (None, None, "open")
    else:
        assert set(kept_from.values()) <= refused
        assert found["unshare"] == "EPERM"
