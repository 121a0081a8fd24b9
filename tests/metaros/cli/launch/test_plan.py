"""From a launch table to what the supervisor starts, and when."""

from __future__ import annotations

from pathlib import Path

import pytest

from metaros.cli.launch.plan import PROGRAM, Place, check_exists, launches
from metaros.errors import ConfigError
from metaros.supervise.launch_table import parse_table


def test_a_node_starts_after_the_last_of_those_it_comes_after(tmp_path: Path) -> None:
    after = {
        "base": [],
        "lidar": ["base"],
        "map": ["lidar"],
        "drive": ["base", "map"],
        "arm": ["map", "base"],
        "log": [],
    }
    rows = (f'[[node]]\nname = "{name}"\nmodule = "m"\nafter = {before}\n' for name, before in after.items())
    table = parse_table("".join(rows), tmp_path / "robot.toml")
    planned = launches(table, Place(zenoh_port=7447, domain=0, log_dir=tmp_path))
    stages = {launch.name: launch.stage for launch in planned}
    assert stages == {"base": 0, "log": 0, "lidar": 1, "map": 2, "drive": 3, "arm": 3}


def test_a_driver_is_looked_up_among_the_kinds_of_drivers_and_nothing_else_of_its_row(tmp_path: Path) -> None:
    text = '[[node]]\nname = "host"\ndriver = "host_metrics"\n[[node]]\nname = "late"\nmodule = "there.is.none"\n'
    table = parse_table(text, tmp_path / "robot.toml")
    with pytest.raises(ConfigError, match=r"'late': module: there is no module 'there\.is\.none'"):
        check_exists(table)
    host = launches(table, Place(zenoh_port=7447, domain=0, log_dir=tmp_path))[0].argv
    assert host[: len(PROGRAM) + 2] == (*PROGRAM, "driver", "host_metrics")


def test_a_program_of_ros_2_is_looked_up_as_it_is_run_and_keeps_its_arguments(tmp_path: Path) -> None:
    (tmp_path / "talker.py").touch()
    row = '[[node]]\nname = "talker"\nros2 = "{}"\nargs = ["-v"]\nremap = {{ chatter = "/talk" }}\n'
    table = parse_table(row.format("talker.py"), tmp_path / "robot.toml")
    check_exists(table)
    (planned,) = launches(table, Place(zenoh_port=7447, domain=0, log_dir=tmp_path))
    ros = ("--ros-args", "-r", "__node:=talker", "-r", "chatter:=/talk")
    assert planned.argv == (*PROGRAM, "ros2", "talker.py", "-v", *ros)
    assert planned.cwd == tmp_path
    for wrong, said in {"gone.py": "there is no file", "no_package talker": "no package with executables"}.items():
        with pytest.raises(ConfigError, match=rf"robot\.toml: \[\[node\]\] 'talker': ros2: .*{said}"):
            check_exists(parse_table(row.format(wrong), tmp_path / "robot.toml"))
