"""The Python of two how-to pages, run as it stands there."""

from __future__ import annotations

import os
import re
import subprocess
import sys
from pathlib import Path

import pytest

from tests.examples.test_examples import ROOT
from tests.support.processes.processes import END_S, started


@pytest.mark.parametrize("page", ["custom_messages", "images_audio_points"])
def test_the_pages_python_runs(page: str, zenoh_router: str, tmp_path: Path) -> None:
    if page == "images_audio_points":
        pytest.importorskip("cv2")
    blocks = re.findall(r"```python\n(.*?)```", (ROOT / "docs" / "howto" / f"{page}.md").read_text(), re.DOTALL)
    assert len(blocks) >= 4
    script = tmp_path / f"{page}.py"
    script.write_text("\n".join(blocks), encoding="utf-8")
    environment = {**os.environ, "METAROS_ZENOH_PORT": zenoh_router.rsplit(":", 1)[1]}
    with started([sys.executable, str(script)], stderr=subprocess.STDOUT, cwd=ROOT, env=environment) as process:
        out, _ = process.communicate(timeout=END_S)
    assert process.returncode == 0, out
