"""The status file appears whole and goes away."""

from __future__ import annotations

import json
import os
from pathlib import Path

from edge_agent.status.status_file import status_file


def test_there_while_the_block_runs(tmp_path: Path) -> None:
    path = tmp_path / "deep" / "agent.json"
    with status_file(path, name="sim_1"):
        assert json.loads(path.read_text()) == {"pid": os.getpid(), "ready": True, "name": "sim_1"}
        assert list(path.parent.iterdir()) == [path]
    assert not path.exists()


def test_none_means_none() -> None:
    with status_file(None):
        pass
