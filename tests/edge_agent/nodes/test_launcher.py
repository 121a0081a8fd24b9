"""What the supervisor, and with it every node, gets of its agent."""

from __future__ import annotations

import os
import sys
from pathlib import Path

import pytest

from edge_agent.nodes.launcher import BASE_PYTHON, Launcher
from tests.support.waiting import wait_until


@pytest.mark.skipif(sys.platform == "win32", reason="a script stands for the interpreter")
def test_nodes_do_not_inherit_what_people_keep_secret(tmp_path: Path) -> None:
    """Who starts an agent by hand may have a key, or a database's password, in their environment."""
    script, reported = tmp_path / "python", tmp_path / "environ"
    script.write_text(f"#!/bin/sh\nenv > {reported}.part && mv {reported}.part {reported}\n")
    script.chmod(0o700)
    secrets = {"METAROS_KEY": "mrk_x", "METAROS_STORE": "postgres://a:b@c/d", "METAROS_OBJECTS": "s3://k:s@h/b"}
    environ = {"PATH": os.environ["PATH"], "ROBOT_MODEL": "cart", BASE_PYTHON: str(script), **secrets}
    Launcher(tmp_path, environ=environ).start()
    wait_until(reported.exists)
    names = {line.partition("=")[0] for line in reported.read_text().splitlines()}
    assert "ROBOT_MODEL" in names
    assert not names & secrets.keys()
