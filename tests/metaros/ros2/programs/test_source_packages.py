"""Packages in source: found as colcon finds them, read and not run."""

from __future__ import annotations

from pathlib import Path

from metaros.ros2.programs.source_packages import source_packages


def test_packages_and_what_they_can_run(workspace: Path) -> None:
    found = {package.name: package for package in source_packages(workspace)}
    assert sorted(found) == ["my_robot", "other", "tools"]
    assert found["my_robot"].entry_points() == {
        "talker": "my_robot.talker:main",
        "listener": "my_robot.nodes.listener:main",
        "server": "my_robot.server:Server.run",
    }
    assert found["other"].entry_points() == {"one": "other.one:main", "two": "other.two:main"}
    assert found["tools"].entry_points() == {}
    assert sorted(found["tools"].scripts()) == ["spin", "spin.py", "turn"]
    assert [package.name for package in source_packages(workspace / "src" / "tools")] == ["tools"]


def test_files_that_cannot_be_read_have_no_entry_points(workspace: Path) -> None:
    other = workspace / "src" / "other"
    (other / "setup.py").write_text("setup(entry_points=os.environ['X'])")
    (other / "setup.cfg").write_text("no section")
    (other / "pyproject.toml").write_text("[project.scripts")
    (package,) = source_packages(other)
    assert package.entry_points() == {}
    for text in ("def broken(", "-" * 100_000 + "1", "name = " + " + ".join(["'a'"] * 5_000)):
        (other / "setup.py").write_text(text)
        assert package.entry_points() == {}, text[:10]
    (other / "package.xml").write_text("<package/>")
    assert list(source_packages(other)) == []
