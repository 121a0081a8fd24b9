"""The command line of the publisher of one transform."""

from __future__ import annotations

import math

import pytest

from metaros.errors import ConfigError
from metaros.ros2.tf2_ros.static_transform_publisher import parse

HALF = math.sqrt(0.5)


def test_old_and_new_arguments_mean_the_same() -> None:
    turn = str(math.pi / 2)
    table = {
        f"1 2 -3 {turn} 0 0 map odom": ((1.0, 2.0, -3.0), (0.0, 0.0, HALF, HALF)),
        f"--x 1 --y 2 --z -3 --yaw {turn} --frame-id map --child-frame-id odom": ((1.0, 2.0, -3.0), (0, 0, HALF, HALF)),
        f"--roll {turn} --frame-id map --child-frame-id odom": ((0.0, 0.0, 0.0), (HALF, 0.0, 0.0, HALF)),
        f"--pitch {turn} --frame-id map --child-frame-id odom": ((0.0, 0.0, 0.0), (0.0, HALF, 0.0, HALF)),
        "0 0 1 0 0 1 0 map odom": ((0.0, 0.0, 1.0), (0.0, 0.0, 1.0, 0.0)),
        "--qz 1 --qw 0 --frame-id map --child-frame-id odom": ((0.0, 0.0, 0.0), (0.0, 0.0, 1.0, 0.0)),
    }
    for line, (place, rotation) in table.items():
        found = parse(line.split())
        assert (found.frame_id, found.child_frame_id, found.place) == ("map", "odom", place), line
        assert found.rotation == pytest.approx(rotation), line


def test_what_makes_no_sense_is_said() -> None:
    for line, word in {
        "--frame-id map": "child-frame-id",
        "--frame-id a --child-frame-id a": "differ",
        "--yaw 1 --qw 1 --frame-id a --child-frame-id b": "not both",
        "--x up --frame-id a --child-frame-id b": "up",
        "1 2 3": "unrecognized",
    }.items():
        with pytest.raises(ConfigError, match=word):
            parse(line.split())
