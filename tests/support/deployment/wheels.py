"""Wheels of this project as a robot's update brings them: whole, or with an agent that ends at its start."""

from __future__ import annotations

import base64
import functools
import hashlib
import io
import re
import shutil
import subprocess
import sys
import zipfile
from pathlib import Path
from tempfile import TemporaryDirectory

from tests.support.processes.processes import END_S

__all__ = ["wheel_of"]

ROOT = Path(__file__).resolve().parents[3]
BUILT = "2.1.0"
MAIN = "edge_agent/main.py"
UNUSED = ("automation/functions", "automation/rules", "broker", "client", "convert", "sim")  # of metaros, by an agent


def wheel_of(version: str, *, broken: bool = False) -> tuple[str, bytes]:
    """Name and bytes of a wheel of that version.

    A broken one's agent ends at its start; it brings that agent alone, and the base install the rest.
    """
    old, new = (f"metaros-{one}.dist-info" for one in (BUILT, version))
    target, rows = io.BytesIO(), []
    with zipfile.ZipFile(io.BytesIO(_built())) as source, zipfile.ZipFile(target, "w", zipfile.ZIP_DEFLATED) as wheel:
        for member in source.infolist():
            name, data = member.filename.replace(old, new), source.read(member)
            if name == f"{new}/RECORD" or (broken and name.startswith("metaros/")):
                continue
            if name == f"{new}/METADATA":
                data = data.replace(f"\nVersion: {BUILT}\n".encode(), f"\nVersion: {version}\n".encode())
            elif name == MAIN and broken:
                data += b"\nraise SystemExit('this version does not start')\n"
            digest = base64.urlsafe_b64encode(hashlib.sha256(data).digest()).rstrip(b"=").decode()
            rows.append(f"{name},sha256={digest},{len(data)}\n")
            wheel.writestr(name, data)
        wheel.writestr(f"{new}/RECORD", "".join([*rows, f"{new}/RECORD,,\n"]))
    return f"metaros-{version}-py3-none-any.whl", target.getvalue()


@functools.cache
def _built() -> bytes:
    """As hatchling builds it, without what no agent runs: each install compiles all that is there."""
    with TemporaryDirectory() as folder:
        tree, out = Path(folder) / "tree", Path(folder) / "out"
        for package in ("metaros", "edge_agent"):
            shutil.copytree(ROOT / package, tree / package, ignore=shutil.ignore_patterns("__pycache__"))
        for package in UNUSED:
            shutil.rmtree(tree / "metaros" / package)
        (tree / "gateway").mkdir()
        shutil.copy(ROOT / "gateway" / "__init__.py", tree / "gateway")
        for name in ("README.md", "LICENSE"):
            shutil.copy(ROOT / name, tree)
        project = (ROOT / "pyproject.toml").read_text()
        project = re.sub(r'^version = ".*"$', f'version = "{BUILT}"', project, count=1, flags=re.MULTILINE)
        project = re.sub(r"\[tool\.hatch\.build\.hooks\.custom\]\npath = .*\n", "", project)
        (tree / "pyproject.toml").write_text(project)
        build = [sys.executable, "-m", "hatchling", "build", "-t", "wheel", "-d", str(out)]
        done = subprocess.run(build, cwd=tree, capture_output=True, text=True, timeout=END_S * 2, check=False)
        assert done.returncode == 0, done.stderr
        (wheel,) = out.glob("*.whl")
        return wheel.read_bytes()
