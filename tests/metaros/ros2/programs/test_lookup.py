"""Which program a command line names."""

from __future__ import annotations

from pathlib import Path

import pytest

from metaros.errors import ConfigError
from metaros.ros2.programs import executables, find_program


@pytest.fixture
def prefix(workspace: Path) -> Path:
    """A built workspace: a script of Python, a program that is none, and modules."""
    built = workspace / "install"
    for path, text in {
        "lib/my_robot/talker": "#!/usr/bin/python3\n",
        "lib/my_robot/engine": "\x7fELF",
        "share/my_robot/package.xml": "",
        "lib/python3.8/site-packages/my_robot/__init__.py": "",
    }.items():
        (built / path).parent.mkdir(parents=True, exist_ok=True)
        (built / path).write_text(text)
        (built / path).chmod(0o755)
    return built


def test_files_modules_and_executables(workspace: Path, prefix: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(workspace)
    robot, scripts = workspace / "src/robots/my_robot", workspace / "src/tools/scripts"
    (workspace / "drive.py").touch()
    (workspace / "pack").mkdir()
    (workspace / "pack" / "__main__.py").touch()
    (workspace / "pack" / "__init__.py").touch()
    cases = {
        "drive.py a -r": ("drive.py", ["a", "-r"], (str(workspace),)),
        "./src/tools/scripts/spin.py": (
            "src/tools/scripts/spin.py",
            [],
            (str(scripts), str(workspace / "src/tools")),
        ),
        "src/robots/my_robot/setup.py": ("src/robots/my_robot/setup.py", [], (str(robot),)),
        "json.tool --x y": ("json.tool", ["--x", "y"], (str(workspace),)),
        "drive x": ("drive", ["x"], (str(workspace),)),
        "pack": ("pack", [], (str(workspace),)),
        "my_robot talker --ros-args": ("my_robot.talker:main", ["--ros-args"], (str(robot),)),
        "my_robot server": ("my_robot.server:Server.run", [], (str(robot),)),
        "tools spin 1": (str(scripts / "spin.py"), ["1"], (str(scripts), str(workspace / "src/tools"))),
        "uvicorn uvicorn -q": ("uvicorn.main:main", ["-q"], ()),
    }
    found = {}
    for words in cases:
        program, rest = find_program(words.split(), environ={})
        found[words] = (str(program), rest, program.path)
    assert found == cases
    environ = {"AMENT_PREFIX_PATH": f"/nowhere:{prefix}"}
    program, rest = find_program(["my_robot", "talker", "1"], environ=environ)
    assert (program.file, rest) == (prefix / "lib/my_robot/talker", ["1"])
    assert program.path == (str(prefix / "lib/my_robot"), str(prefix / "lib/python3.8/site-packages"))
    assert find_program(["my_robot", "engine"], environ=environ)[0].binary == prefix / "lib/my_robot/engine"
    asked_for = find_program(["my_robot", "talker"], package_path=[workspace / "src"], environ=environ)[0]
    assert asked_for.function == "my_robot.talker:main"


def test_what_is_not_there_is_said_with_what_is(workspace: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(workspace)
    cases = {
        "": "what shall run",
        "no.py": r"there is no file no\.py",
        "my_robot talkr": "no executable 'talkr'; did you mean talker",
        "my_robot what": "there are: listener, server, talker",
        "my_robot": "my_robot is a package; there are: listener",
        "my_robt talker": "did you mean my_robot",
        "os.nothing": "no file, no module, and no package",
        "json": "no file, no module",  # a package without __main__
    }
    for words, named in cases.items():
        with pytest.raises(ConfigError, match=named):
            find_program(words.split(), environ={})


def test_all_executables(workspace: Path, prefix: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(workspace / "src")
    rows = {(row.package, row.name) for row in executables(environ={"AMENT_PREFIX_PATH": str(prefix)})}
    assert rows == {
        ("my_robot", "talker"),
        ("my_robot", "listener"),
        ("my_robot", "server"),
        ("my_robot", "engine"),
        ("other", "one"),
        ("other", "two"),
        ("tools", "spin.py"),
        ("tools", "turn"),
        ("tf2_ros", "static_transform_publisher"),
    }
