"""What nodes publish: known by both spellings, also after the node is dead, and bounded."""

from __future__ import annotations

from gateway.alerting.watch import published as module
from gateway.alerting.watch.published import Published


def test_a_node_is_known_by_its_name_and_its_topics_by_both_spellings() -> None:
    known = Published()
    known.learn("r1", 1, {"/r1/scan": ["/r1/lidar"], "/r1/tf": ["/r1/lidar", "/r1/base"]})
    reported = {"/r1/scan", "/r1/tf"}
    assert known.topics_of("r1", "lidar") == known.topics_of("r1", "/r1/lidar") == reported
    assert known.topics_of("r1", "dar") == set()
    assert known.topics_of("r2", "lidar") == set()


def test_a_dead_node_keeps_its_topics_and_a_living_one_has_those_of_now() -> None:
    known = Published()
    known.learn("r1", 1, {"/scan": ["/lidar"], "/old": ["/base"]})
    known.learn("r1", 2, {"/new": ["/base"]})
    assert "/scan" in known.topics_of("r1", "lidar")
    assert known.topics_of("r1", "base") == {"/new"}


def test_it_is_bounded() -> None:
    known = Published()
    for robot in range(module.MAX_ROBOTS + 10):
        known.learn(f"r{robot}", 1, {"/a": ["/n"]})
    assert known.topics_of("r0", "n") == set()
    for revision in range(module.MAX_NODES + 10):
        known.learn("r", revision, {"/a": [f"/n{revision}"]})
    assert known.topics_of("r", "n0") == set()
    assert known.topics_of("r", f"n{revision}")
