"""The TypeScript client: its types are those of the gateway's OpenAPI, and what it compiles to works under Node."""

from __future__ import annotations

import os
import shutil
import subprocess
from pathlib import Path

import pytest

from tests.e2e.real.gateway import real_gateway
from tools.gen_ts_client import TARGET, document, render

ROOT = Path(__file__).resolve().parents[2]
CLIENT = ROOT / "dashboard" / "src" / "api"
NODE = shutil.which("node")
TSC = ROOT / "dashboard" / "node_modules" / ".bin" / "tsc"


def test_its_types_are_those_of_the_openapi_document() -> None:
    assert TARGET.read_text() == render(document()), "run python tools/gen_ts_client.py"


@pytest.mark.integration
def test_the_compiled_package_calls_a_real_gateway(tmp_path: Path) -> None:
    if NODE is None or not TSC.exists():
        if os.environ.get("CI"):
            pytest.fail("CI needs Node and the dashboard's packages")
        pytest.skip("no Node, or the dashboard's packages are not installed")
    dist = tmp_path / "dist"
    subprocess.run([str(TSC), "-p", str(CLIENT), "--outDir", str(dist)], check=True, timeout=300)
    (dist / "package.json").write_text('{"type": "module"}')
    with real_gateway(tmp_path) as gateway:
        scenario = [NODE, str(Path(__file__).parent / "typescript_client.mjs"), str(dist), gateway.url, gateway.admin]
        done = subprocess.run(scenario, capture_output=True, text=True, timeout=300)
    assert (done.returncode, done.stdout.strip()) == (0, "all well"), done.stderr
