"""Files that stand in for executables of packages in source, and for `ros2`."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest

from metaros.errors import ConfigError
from metaros.ros2.programs.stand_ins import executable_file, folder_with_ros2, ros2_file

pytestmark = pytest.mark.skipif(sys.platform == "win32", reason="scripts of a shell")


def output(*words: str | Path, folder: Path) -> tuple[int, str]:
    """What a file that is run there prints."""
    ended = subprocess.run([*map(str, words)], cwd=folder, capture_output=True, text=True, timeout=30, check=False)
    return ended.returncode, ended.stdout + ended.stderr


def test_a_file_runs_an_executable_of_a_package_in_source(
    workspace: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(workspace / "src")
    path = executable_file("my_robot", "talker", {})
    assert (path.name, executable_file("my_robot", "talker", {})) == ("talker", path)
    assert output(path, "--end-after", "a b", folder=Path("/")) == (3, "['talker', '--end-after', 'a b']\n")
    with pytest.raises(ConfigError, match="talker"):
        executable_file("my_robot", "talke", {})
    built = tmp_path / "lib" / "pkg" / "tool"
    built.parent.mkdir(parents=True)
    built.write_bytes(b"\x7fELF")
    assert executable_file("pkg", "tool", {"AMENT_PREFIX_PATH": str(tmp_path)}) == built


def test_ros2_is_ours_where_there_is_no_other(workspace: Path, tmp_path: Path) -> None:
    other = tmp_path / "bin"
    other.mkdir()
    assert folder_with_ros2(str(other)) == str(Path(ros2_file()).parent)
    assert output(ros2_file(), "run", "my_robot", "talker", "x", folder=workspace) == (3, "['talker', 'x']\n")
    code, text = output(ros2_file(), "interface", "show", "std_msgs/msg/Empty", folder=workspace)
    assert code == 0, text
    assert "RIHS01_" in text
    (other / "ros2").touch(mode=0o755)
    assert folder_with_ros2(str(other)) is None
