"""A wheel built from the repository serves the dashboard with no Node on the machine.

That installers take it is shown by `tests/deploy/test_dockerfile.py` and `test_update_rollout.py`.
"""

from __future__ import annotations

import json
import subprocess
import sys
import urllib.request
import zipfile
from pathlib import Path

import pytest

from tests.support.ports import free_port
from tests.support.processes.processes import started
from tests.support.waiting import wait_until

ROOT = Path(__file__).resolve().parents[3]


@pytest.mark.integration
@pytest.mark.timeout(600)
def test_wheel_serves_the_dashboard_without_node(tmp_path: Path) -> None:
    build = [sys.executable, "-m", "hatchling", "build", "-t", "wheel", "-d", str(tmp_path)]
    subprocess.run(build, check=True, cwd=ROOT)
    (wheel,) = tmp_path.glob("metaros-*.whl")
    site = tmp_path / "site"
    with zipfile.ZipFile(wheel) as archive:
        names = archive.namelist()
        archive.extractall(site)  # what an installer does with a wheel that is pure
    assert "gateway/static/index.html" in names
    assert not [name for name in names if name.startswith(("dashboard/", "tests/", "node_modules/"))]

    # An empty PATH: no node, no npm. PYTHONPATH comes before the editable install of this checkout.
    environment = {"PATH": str(tmp_path), "PYTHONPATH": str(site), "HOME": str(tmp_path)}
    where = subprocess.run(
        [sys.executable, "-c", "import gateway; print(gateway.__file__)"],
        env=environment,
        cwd=tmp_path,
        capture_output=True,
    )
    assert str(site) in where.stdout.decode(), "the wheel, not this checkout"
    status, port = tmp_path / "status.json", free_port()
    command = [sys.executable, "-m", "metaros", "gateway", "--port", str(port), "--grpc-port", str(free_port())]
    command += ["--data-dir", str(tmp_path / "data"), "--status-file", str(status)]
    with (
        (tmp_path / "log").open("wb") as log,
        started(command, cwd=tmp_path, env=environment, stdout=log, stderr=log) as gateway,
    ):
        wait_until(lambda: status.exists() or gateway.poll() is not None, timeout_s=60)
        assert status.exists(), (tmp_path / "log").read_text()
        page = urllib.request.urlopen(f"http://127.0.0.1:{port}/", timeout=120).read().decode()
        assert '<div id="app"' in page
        assert json.loads(status.read_text())["pid"] == gateway.pid
