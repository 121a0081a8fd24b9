"""From a launch table to what the supervisor starts, and when."""

from __future__ import annotations

from pathlib import Path

from metaros.cli.launch_plan import Place, launches
from metaros.supervise.table import parse_table


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
