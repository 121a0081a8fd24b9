"""JSON lines, tables, pictures."""

from __future__ import annotations

import csv
import io
import json
from pathlib import Path

import numpy as np
import pytest

from metaros.errors import FieldError, RecordingError
from metaros.interfaces.geometry_msgs.msg import PointStamped
from metaros.interfaces.sensor_msgs.msg import CompressedImage, Image, LaserScan
from metaros.record import Bag, export_csv, export_images, export_json, open_bag
from metaros.record.export import png
from tests.support.nodes.bags import START_NS, arrivals, write_bag


def bag_of(folder: Path, *messages: object, topic: str = "/a/b") -> Bag:
    write_bag(folder / "in.mcap", arrivals(topic, list(messages)))
    return open_bag(folder / "in.mcap")


def point(x: float) -> PointStamped:
    message = PointStamped()
    message.header.frame_id = "map"
    message.point.x = x
    return message


def test_json_lines(tmp_path: Path) -> None:
    out = io.StringIO()
    assert export_json(bag_of(tmp_path, point(1.5), point(2.5)).messages(), out) == 2
    first = json.loads(out.getvalue().splitlines()[0])
    assert (first["topic"], first["type"], first["log_ns"]) == ("/a/b", "geometry_msgs/msg/PointStamped", START_NS)
    assert first["message"]["point"]["x"] == 1.5


def test_tables(tmp_path: Path) -> None:
    bag = bag_of(tmp_path, point(1.5), point(2.5))
    made = export_csv(bag.messages(), tmp_path / "all")
    assert made == {tmp_path / "all" / "a.b.csv": 2}
    (row, _) = csv.DictReader((tmp_path / "all" / "a.b.csv").read_text().splitlines())
    assert (row["header.frame_id"], row["point.x"], row["log_ns"]) == ("map", "1.5", str(START_NS))
    export_csv(bag.messages(), tmp_path / "some", fields=["point.x"])
    assert (tmp_path / "some" / "a.b.csv").read_text().splitlines()[0] == "log_ns,publish_ns,point.x"
    with pytest.raises(FieldError, match=r"point\.q"):
        export_csv(bag.messages(), tmp_path / "none", fields=["point.q"])


def test_arrays_are_one_cell(tmp_path: Path) -> None:
    bag = bag_of(tmp_path, LaserScan(ranges=[1.0, 2.0]))
    export_csv(bag.messages(), tmp_path / "out")
    (row,) = csv.DictReader((tmp_path / "out" / "a.b.csv").read_text().splitlines())
    assert json.loads(row["ranges"]) == [1.0, 2.0]


@pytest.mark.parametrize(("encoding", "shape"), [("rgb8", (2, 3, 3)), ("bgr8", (2, 3, 3)), ("mono8", (2, 3, 1))])
def test_pictures(encoding: str, shape: tuple[int, ...], tmp_path: Path) -> None:
    pixels = np.arange(np.prod(shape), dtype=np.uint8).reshape(shape)
    image = Image(
        height=2,
        width=3,
        encoding=encoding,
        step=3 * shape[2] + 2,
        data=np.pad(pixels.reshape(2, -1), ((0, 0), (0, 2))).tobytes(),
    )
    made = export_images(bag_of(tmp_path, image).messages(), tmp_path / "out")
    assert made == {tmp_path / "out" / "a.b": 1}
    written = (tmp_path / "out" / "a.b" / f"{START_NS}.png").read_bytes()
    expected = pixels[:, :, ::-1] if encoding == "bgr8" else pixels[:, :, 0] if encoding == "mono8" else pixels
    assert written == png(np.ascontiguousarray(expected))


def test_a_png_is_read_by_others(tmp_path: Path) -> None:
    cv2 = pytest.importorskip("cv2")
    for kind in (np.uint8, np.uint16):
        pixels = np.arange(24, dtype=kind).reshape(4, 6) * 7
        found = cv2.imdecode(np.frombuffer(png(pixels), np.uint8), cv2.IMREAD_UNCHANGED)
        np.testing.assert_array_equal(found, pixels)
    colour = np.arange(36, dtype=np.uint8).reshape(3, 4, 3)
    found = cv2.imdecode(np.frombuffer(png(colour), np.uint8), cv2.IMREAD_UNCHANGED)
    np.testing.assert_array_equal(found[:, :, ::-1], colour)


def test_compressed_pictures_are_copied(tmp_path: Path) -> None:
    image = CompressedImage(format="jpeg", data=b"\xff\xd8 whatever")
    export_images(bag_of(tmp_path, image).messages(), tmp_path / "out")
    assert (tmp_path / "out" / "a.b" / f"{START_NS}.jpg").read_bytes() == b"\xff\xd8 whatever"


def test_what_is_no_picture(tmp_path: Path) -> None:
    with pytest.raises(RecordingError, match="yuv422"):
        export_images(bag_of(tmp_path, Image(encoding="yuv422")).messages(), tmp_path / "out")


def test_an_image_that_lies(tmp_path: Path) -> None:
    liar = Image(height=1000, width=1000, encoding="mono8", step=1000, data=b"x")
    with pytest.raises(RecordingError, match="smaller than it says"):
        export_images(bag_of(tmp_path, liar).messages(), tmp_path / "out")
