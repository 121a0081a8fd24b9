"""Names from outside that would be files that we write: of a gateway's answer, a recording, a robot, a launch table."""

from __future__ import annotations

import hashlib
import json
import os
import shutil
import sys
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from edge_agent.blackbox.recording_store import RecordingStore
from edge_agent.cli.status import directories
from edge_agent.state.state_dir import default_state_dir
from gateway.history.recordings.partial_files import PartialFiles
from metaros.cli.main import main
from metaros.errors import ConfigError, UsageError
from metaros.interfaces.sensor_msgs.msg import Image
from metaros.interfaces.std_msgs.msg import String
from metaros.record import export_csv, export_images, open_bag
from metaros.supervise.launch_table import parse_table
from tests.gateway.harness import running_gateway
from tests.gateway.history.recordings.robot import RecordingRobot, content
from tests.security.input.test_paths import NAMES, root, tree
from tests.support.nodes.bags import arrivals, write_bag
from tests.support.servers.hostile_gateway import hostile_gateway

__all__ = ["root"]  # the fixture

BLOB = b"what a hostile gateway wants to have somewhere"
SHA256 = hashlib.sha256(BLOB).hexdigest()
SENT = [name for name in NAMES if not set(name) & {"\0", "\ud800"}]
_TOPICS = ("..", "/..", "/../", "/../..", "/../secret", "/.", "/a/../..")
ID = "01JD0000000000000000000000"


def recording(**other: Any) -> dict[str, Any]:
    """What a gateway says about a recording that it has."""
    known = {"id": ID, "robot": "sim_1", "state": "stored", "first": "2026-11-21T06:00:00Z", "start": None}
    known |= {"sha256": SHA256, "size_bytes": len(BLOB), "url": "/file", "message": "", "code": ""}
    return known | other


def metaros(*words: str) -> int:
    """A command; its exit code."""
    with pytest.raises(SystemExit) as ended:
        main(words)
    return int(ended.value.code or 0)


@pytest.fixture
def here(root: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """The current folder, with secrets above it; and a home that is none of these."""
    (tmp_path / "home").mkdir()
    monkeypatch.setenv("HOME", str(tmp_path / "home"))
    monkeypatch.setenv("METAROS_KEY", "x")
    monkeypatch.chdir(root)
    return root


def names_of_files() -> Iterator[tuple[str, str]]:
    """A field of a recording, and what it says: the robot's name goes into the file's, of the others each third.

    Of these every other one stands behind something that is right.
    """
    for place, name in enumerate(NAMES):
        yield "robot", name
        field = ("first", "start", "sha256")[place % 3]
        behind = f"{'0' * 8}/../{name}" if field == "sha256" else f"2026-11-21T06:00:00{name}"
        yield field, behind if place % 2 else name


@pytest.mark.integration
def test_a_gateway_does_not_say_where_a_recording_goes(
    here: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    before = tree(tmp_path)
    answers: dict[str, Any] = {"/file": BLOB}
    headers = {"Content-Disposition": 'attachment; filename="../../secret"'}
    with hostile_gateway(answers, headers=headers) as url:
        for field, value in names_of_files():
            known = {"first": None} if field == "start" else {}
            answers["/api/v1/recordings/"] = recording(**known, **{field: value})
            code = metaros("recording", "get", ID, "--gateway", url)
            assert code in (0, 1, 2)
            said = capsys.readouterr()
            assert "Traceback" not in said.err
            if code == 0:
                made = here / said.out.strip()
                assert made.parent == here
                assert made.name.isascii()
                assert made.read_bytes() == BLOB
                made.unlink()
            assert tree(tmp_path) == before, (field, value)
        answers["/api/v1/recordings/"] = recording()
        assert metaros("recording", "get", ID, "--gateway", url) == 0
        assert (here / "sim_1_2026-11-21T06-00-00Z.mcap").read_bytes() == BLOB


def test_a_file_of_ours_is_where_we_said(here: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    headers = {"Content-Disposition": 'attachment; filename="/etc/passwd"'}
    export = b"\x89MCAP0\r\n" * 2
    answers = {"/file": BLOB, "/api/v1/recordings/": recording(robot="../x"), "/api/v1/export.mcap": export}
    with hostile_gateway(answers, headers=headers) as url:
        assert metaros("recording", "get", ID, "--file", "mine.mcap", "--gateway", url) == 0
        assert metaros("history", "export", "all.mcap", "--robot", "../x", "--gateway", url) == 0
        assert metaros("history", "export", "mine.mcap", "--robot", "r1", "--gateway", url) == 2, "not overwritten"
        for folder in (".", "..", "/", ""):
            assert metaros("recording", "get", ID, "--file", folder, "--gateway", url) == 2, folder
            assert metaros("history", "export", folder, "--robot", "r1", "--gateway", url) == 2, folder
            assert "Traceback" not in capsys.readouterr().err
    assert sorted(path.name for path in here.iterdir()) == ["all.mcap", "mine.mcap"]
    assert (here / "mine.mcap").read_bytes() == BLOB


def test_a_file_that_is_larger_than_said_is_not_taken(here: Path, capsys: pytest.CaptureFixture[str]) -> None:
    answers = {"/file": BLOB * 1_000_000, "/api/v1/recordings/": recording()}
    with hostile_gateway(answers) as url:
        assert metaros("recording", "get", ID, "--gateway", url) == 1
    assert "larger than" in capsys.readouterr().err
    assert sum(path.stat().st_size for path in here.iterdir()) <= len(BLOB)


@pytest.mark.integration
@pytest.mark.parametrize("export", [export_images, export_csv])
def test_what_is_exported_stays_in_its_folder(
    export: Callable[..., dict[Path, int]], here: Path, tmp_path: Path
) -> None:
    picture = Image(encoding="mono8", width=1, height=1, step=1, data=np.zeros(1, np.uint8))
    bag, out, before = tmp_path / "in.mcap", here / "out", tree(tmp_path)
    for name in (*SENT[::3], *_TOPICS):
        write_bag(bag, arrivals(name, [picture]))
        (place,) = export(open_bag(bag).messages(), out)
        assert place.parent == out, name
        assert not set(place.name) & set("/\\:\0 "), name
        assert {path for path in tree(tmp_path) if not path.startswith(str(out))} == {*before, str(bag)}, name
        bag.unlink()
        shutil.rmtree(out)


@pytest.mark.parametrize("verb", ["cut", "recover", "export"])
def test_a_bag_is_not_written_over(verb: str, here: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    write_bag(here / "in.mcap", arrivals("/a", [String(data="x")]))
    before = tree(tmp_path)
    if sys.platform != "win32":
        (here / "link.mcap").symlink_to(tmp_path / "new")
    for target in ("in.mcap", "../secret", "../../secret.mcap", "..", ".", "/", "link.mcap"):
        if not Path(target).exists() and sys.platform == "win32":
            continue
        assert metaros("bag", verb, "in.mcap", target) in (1, 2), target
        assert "Traceback" not in capsys.readouterr().err
    assert tree(tmp_path) == before
    assert not (tmp_path / "new").exists()


def test_an_agents_state_is_below_its_folder(here: Path, tmp_path: Path) -> None:
    home = tmp_path / "home" / ".metaros" / "agent"
    taken = 0
    for name in NAMES:
        try:
            found = default_state_dir(name)
        except ConfigError:
            continue
        taken += 1
        assert found.parent == home, name
        assert found.name == name
        assert name not in (".", "..")
    assert 0 < taken < len(NAMES) // 5
    for name in ("../../x", "/etc", ".."):
        assert metaros("agent", "--name", name) == 2
        with pytest.raises(ConfigError):
            directories(name, None)


def test_a_clip_on_a_robot_is_called_by_an_id(root: Path, tmp_path: Path) -> None:
    before, shelf = tree(tmp_path), RecordingStore(root)
    shelf.check(ID)
    for name in (*NAMES, f"{ID}\n", f"{ID}/..", f"../{ID}", ID.lower()):
        with pytest.raises(UsageError):
            shelf.check(name)
    assert {path: data for path, data in tree(tmp_path).items() if path in before} == before


def test_what_comes_to_a_gateway_is_called_by_an_id(root: Path, tmp_path: Path) -> None:
    incoming = PartialFiles(root / "incoming", reserve_bytes=0)
    before = tree(tmp_path)
    good = incoming.file(ID, sha256=SHA256, size_bytes=1)
    assert good.path.parent == root / "incoming"
    for name in (*NAMES, f"{ID}\n", f"{ID}/..", f"../{ID}", "*"):
        with pytest.raises(ValueError, match="no id"):
            incoming.file(name, sha256=SHA256, size_bytes=1)
        with pytest.raises(ValueError, match="no id"):
            incoming.discard(name)
        with pytest.raises(ValueError, match="no id"):
            incoming.file(ID, sha256=name, size_bytes=1)
    assert tree(tmp_path) == before


@pytest.mark.integration
async def test_a_robot_names_no_file_of_the_gateway(tmp_path: Path) -> None:
    for name in ("secret", "secret.mcap"):
        (tmp_path / name).write_bytes(b"secret")
    blob = content(1000)
    offered = 0
    async with running_gateway(tmp_path / "deep") as ready:
        places = {path.parent for path in (tmp_path / "deep").rglob("*")}
        for name in SENT[::8]:
            async with RecordingRobot(ready) as robot:
                await robot.offer(name, blob)
                await robot.part(name, blob, 0)
                offered += 1
        data = {path for path in (tmp_path / "deep").rglob("*") if path.is_file()}
        assert not [path for path in data if path.suffix == ".partial" or path.read_bytes() == blob]
        assert {path.parent for path in data} <= places | {ready.data_dir}
    assert offered > 25
    assert set(os.listdir(tmp_path)) == {"deep", "secret", "secret.mcap"}


def test_a_launch_table_names_no_file() -> None:
    for name in NAMES:
        table = f'[[node]]\nname = {json.dumps(name)}\ncommand = ["true"]\n'
        try:
            (row,) = parse_table(table, Path("x.toml")).nodes
        except ConfigError:
            continue
        assert row.name.isascii(), name
        assert row.name.isidentifier(), name
    assert parse_table('[[node]]\nname = "good"\ncommand = ["true"]\n', Path("x.toml")).nodes[0].name == "good"
