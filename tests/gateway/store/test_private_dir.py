"""Whose a file with a secret is."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest

from gateway.store.private_dir import others_can_read

pytestmark = pytest.mark.skipif(sys.platform == "win32", reason="Windows has no modes")

NOBODY = 65534
ASK = (
    "import os, sys; from pathlib import Path; from gateway.store.private_dir import others_can_read;"
    f" os.setgroups([]); os.setgid({NOBODY}); os.setuid({NOBODY}); print(others_can_read(Path(sys.argv[1])))"
)


@pytest.mark.parametrize(
    ("mode", "read"), [(0o600, False), (0o400, False), (0o640, True), (0o604, True), (0o620, True)]
)
def test_a_users_own_file_is_nobody_elses(tmp_path: Path, mode: int, read: bool) -> None:
    path = tmp_path / "secret"
    path.write_bytes(b"s")
    path.chmod(mode)
    assert others_can_read(path) is read


@pytest.mark.parametrize(("mode", "read"), [(0o440, False), (0o640, False), (0o444, True), (0o660, True)])
def test_root_may_let_the_gateway_in_by_its_group(tmp_path: Path, mode: int, read: bool) -> None:
    if os.getuid() != 0:
        pytest.skip("needs root, who gives a file to a group")
    path = tmp_path / "secret"
    path.write_bytes(b"s")
    path.chmod(mode)
    os.chown(path, 0, NOBODY)
    for folder in (tmp_path, *tmp_path.parents):
        if not folder.stat().st_mode & 0o001:
            folder.chmod(folder.stat().st_mode | 0o011)
    done = subprocess.run([sys.executable, "-c", ASK, str(path)], capture_output=True, text=True)
    assert done.stdout.strip() == str(read), done.stderr
