"""The real `aws` command, in an environment of its own since it pins its libraries: made once a machine."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

from metaros.concurrency.file_lock import file_lock

__all__ = ["aws_command"]

PINNED = "awscli==1.46.2"
FOLDER = Path(__file__).resolve().parents[3] / ".make" / "peers"


def aws_command() -> Path:
    """Its path; the first who asks installs it, and others wait for them."""
    version = f"{sys.version_info.major}.{sys.version_info.minor}"
    folder = FOLDER / f"{PINNED.replace('==', '-')}-{version}"
    places = "Scripts" if sys.platform == "win32" else "bin"
    done, python = folder / "installed", folder / places / ("python.exe" if sys.platform == "win32" else "python")
    FOLDER.mkdir(parents=True, exist_ok=True)
    with file_lock(FOLDER / "awscli.lock"):
        if not done.exists():
            uv = str(Path(sys.executable).with_name("uv.exe" if sys.platform == "win32" else "uv"))
            for step in (
                ["venv", "-q", "--clear", "--python", sys.executable, str(folder)],
                ["pip", "install", "-q", "--python", str(python), PINNED],
            ):
                subprocess.run([uv, *step], check=True, timeout=600, env={**os.environ})
            done.touch()
    return folder / places / ("aws.cmd" if sys.platform == "win32" else "aws")
