"""The examples of custom messages and of images, as a user runs them."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest

import metaros
from metaros import convert
from metaros.cdr import codec
from metaros.cli.shared.topic_lookup import find_topic
from metaros.interfaces.sensor_msgs.msg import CompressedImage
from tests.examples.test_examples import ROOT, running
from tests.support.processes.processes import END_S, started
from tests.support.waiting import wait_until


def test_custom_message_is_received_and_others_learn_its_type(zenoh_router: str, tmp_path: Path) -> None:
    log = tmp_path / "log"
    with running(["examples/custom_message.py"], zenoh_router.rsplit(":", 1)[1], log):
        wait_until(lambda: "A1: 7.5 V in 2 cells, TRICKLE, hottest 21.5 of (2, 3)" in log.read_text(), timeout_s=60)
        with metaros.Context(connect=zenoh_router) as context:
            topic = find_topic(context, "/battery", spin_time=30.0)
        assert topic.type_name == "custom_message/msg/Battery"
        assert codec(topic.type_name, topic.catalogue).hash == topic.type_hash


@pytest.mark.parametrize("example", ["custom_message", "image_pipeline"])
def test_it_ends_by_itself_after_its_count(example: str, zenoh_router: str) -> None:
    if example == "image_pipeline":
        pytest.importorskip("cv2")
    environment = {**os.environ, "METAROS_ZENOH_PORT": zenoh_router.rsplit(":", 1)[1]}
    argv = [sys.executable, f"examples/{example}.py", "--count", "1"]
    with started(argv, stderr=subprocess.STDOUT, cwd=ROOT, env=environment) as process:
        out, _ = process.communicate(timeout=END_S)
    assert process.returncode == 0, out


def test_image_pipeline_gives_a_picture_of_edges(zenoh_router: str, tmp_path: Path) -> None:
    pytest.importorskip("cv2")
    pictures: list[CompressedImage] = []
    with running(["examples/image_pipeline.py"], zenoh_router.rsplit(":", 1)[1], tmp_path / "log"):
        with metaros.Context(connect=zenoh_router) as context, metaros.Node("viewer", context=context) as node:
            node.create_subscription(
                CompressedImage, "/edges/compressed", pictures.append, metaros.qos_sensor_data, dedicated=True
            )
            wait_until(lambda: pictures, timeout_s=60)
        picture = convert.compressed_to_numpy(pictures[0])
        assert picture.shape == (240, 320)
        assert 0.001 < (picture > 128).mean() < 0.05
        assert pictures[0].header.frame_id == "camera"
        assert pictures[0].header.stamp.sec > 0
