"""The list for production: its commands exist, and those with an answer give it at a gateway that is set up so."""

from __future__ import annotations

import os
import re
import subprocess
import sys
from pathlib import Path

import pytest

from metaros.automation.functions.probe import probe
from metaros.automation.functions.sandbox.level import Level
from tests.docs.console import commands_of
from tests.support.deployment.deployed import options_of
from tests.support.processes.stack import Stack
from tests.support.tables import cases

ROOT = Path(__file__).resolve().parents[2]
PAGES = ("howto/one_host.md", "howto/upgrade.md", "topics/production.md", "topics/threat_model.md")
LIST = (ROOT / "docs" / "topics" / "production.md").read_text()


def fenced(text: str) -> list[str]:
    """The lines of commands of a page, continued ones joined."""
    blocks = re.findall(r"```(?:sh|console)\n(.*?)```", text, re.DOTALL)
    return [line.removeprefix("$ ") for block in blocks for line in block.replace("\\\n", " ").splitlines()]


@cases("page", PAGES)
def test_commands_of_ours_are_as_the_page_says(page: str) -> None:
    text = (ROOT / "docs" / page).read_text()
    said = [line for line in fenced(text) if re.search(r"(^|/|\b)metaros [a-z]", line) and "| grep" not in line]
    for line in said:
        words = line[re.search(r"(?:^|[ /])(metaros) [a-z]", line).start(1) :].split()[1:]  # type: ignore[union-attr]
        options_of(words)
    assert said or page == "topics/threat_model.md"


@cases("page", PAGES)
def test_files_of_ours_are_where_the_page_says(page: str) -> None:
    text = (ROOT / "docs" / page).read_text()
    named = set(re.findall(r"\b((?:deploy|tests)/[\w./-]*\w)", text))
    made = {"deploy/.env", "deploy/secrets"}  # by whoever follows the page
    assert [name for name in sorted(named - made) if not (ROOT / name).exists()] == []


@pytest.mark.integration
@pytest.mark.skipif(sys.platform == "win32", reason="the page is for a POSIX shell")
def test_the_answers_are_those_of_a_gateway_that_is_set_up_so(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, warm: Path
) -> None:
    if probe().level < Level.L2:
        assert not os.environ.get("CI"), "CI must have a sandbox of functions"
        pytest.skip("this machine has no sandbox of functions that the page would be content with")
    monkeypatch.setenv("HOME", str(tmp_path))
    with Stack(tmp_path) as stack:
        stack.gateway("--tls", "on", "--no-anonymous", "--require-enrolment", "--sandbox-require", "L2")
        data = tmp_path / "data"
        environment = {
            **os.environ,
            "METAROS_GATEWAY_URL": stack.url.replace("http:", "https:"),
            "METAROS_KEY": stack.key,
            "METAROS_CA": str(data / "root.pem"),
            "DATA": str(data),
            "PATH": f"{warm.parent}:{Path(sys.executable).parent}:{os.environ['PATH']}",
        }
        environment.pop("METAROS_STORE", None)
        for command in commands_of(LIST):
            if "ca-root.key" in command.text:
                (data / "ca-root.key").unlink(missing_ok=True)  # somebody has taken it to a safe place
            shell = ["bash", "-c", command.text]
            done = subprocess.run(shell, env=environment, cwd=tmp_path, capture_output=True, text=True, check=False)
            assert done.returncode == 0, f"{command.text}\n{done.stdout}{done.stderr}"
            wanted = "\n".join(line for line in command.sample if line)
            shape = ".*".join(re.escape(part) for part in wanted.split("…"))
            assert re.fullmatch(shape, done.stdout.strip(), re.DOTALL), f"{command.text}\nprinted: {done.stdout}"
