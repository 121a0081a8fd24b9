"""The VLP-16 driver over real UDP: clouds of a room, filters, losses, strangers, garbage, GPS."""

from __future__ import annotations

import socket
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any

import numpy as np
import pytest

import metaros
from metaros.clock import SystemClock
from metaros.convert import points_to_numpy, quantized_to_numpy
from metaros.drivers.vlp16.receiver import Receiver
from metaros.errors import ConfigError
from metaros.interfaces.metaros_msgs.msg import QuantizedCloud
from metaros.interfaces.sensor_msgs.msg import PointCloud2
from metaros.wire import qos_reliable_all
from tests.support.devices.drivers import RunningDriver, running
from tests.support.devices.room import AHEAD_M, BEHIND_M, LEFT_M, RIGHT_M
from tests.support.devices.vlp16_emulator import FLOOR_M, Vlp16Emulator, position_packet
from tests.support.ports import free_port
from tests.support.waiting import wait_until

Send = Callable[[bytes], Any]


@contextmanager
def lidar_and(context: metaros.Context, **parameters: Any) -> Iterator[tuple[RunningDriver, Send]]:
    """A driver that listens, and how to send it a packet."""
    wire = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
    with wire, running("vlp16", {"port": 0, **parameters}, context=context) as driver:
        wait_until(lambda: "udp_port" in driver.node.status.facts)
        port = int(driver.node.status.facts["udp_port"])
        yield driver, lambda data: wire.sendto(data, ("127.0.0.1", port))


@contextmanager
def turning(emulator: Vlp16Emulator, send: Send, *, pause_s: float = 0.002) -> Iterator[None]:
    """It sends until the block ends, with a pause of 5 ms at about its rate."""
    stop = threading.Event()

    def run() -> None:
        while not stop.wait(pause_s):
            for _ in range(4):
                send(emulator.packet())

    thread = threading.Thread(target=run)
    thread.start()
    try:
        yield
    finally:
        stop.set()
        thread.join(60)


def seen(clouds: list[Any], more: int = 2) -> Any:
    """The newest cloud once so many more have come."""
    goal = len(clouds) + more
    wait_until(lambda: len(clouds) >= goal)
    return clouds[-1]


def assert_room(points: np.ndarray) -> None:
    """Its walls and floor are where they are."""
    assert [points["x"].max(), -points["x"].min()] == pytest.approx([AHEAD_M, BEHIND_M], abs=0.02)
    assert [points["y"].max(), -points["y"].min()] == pytest.approx([LEFT_M, RIGHT_M], abs=0.02)
    assert points["z"].min() == pytest.approx(FLOOR_M, abs=0.02)


def test_clouds_of_a_room_as_ros_drivers_have_them(context: metaros.Context) -> None:
    with lidar_and(context, frame_id="roof") as (driver, send):
        clouds = driver.messages(PointCloud2, "points")
        with turning(Vlp16Emulator(), send):
            cloud = seen(clouds)
            wait_until(lambda: driver.state() == "working" and driver.facts().get("returns") == "strongest")
        assert [(field.name, field.offset, field.datatype) for field in cloud.fields] == [
            ("x", 0, 7),
            ("y", 4, 7),
            ("z", 8, 7),
            ("intensity", 12, 7),
            ("ring", 16, 4),
            ("time", 18, 7),
        ]
        assert (cloud.header.frame_id, cloud.point_step, cloud.height, cloud.is_dense) == ("roof", 22, 1, True)
        points = points_to_numpy(cloud)
        assert_room(points)
        assert sorted(set(points["ring"].tolist())) == list(range(16))


def test_filters_are_obeyed_at_once(context: metaros.Context) -> None:
    with lidar_and(context, voxel_m=0.25) as (driver, send):
        clouds = driver.messages(PointCloud2, "points")
        with turning(Vlp16Emulator(), send):
            assert seen(clouds).width < 3000
            driver.node.parameters.set("voxel_m", 0.0)
            driver.node.parameters.set("z_min_m", 0.0)
            wait_until(lambda: clouds[-1].width > 10_000)
        assert points_to_numpy(clouds[-1])["z"].min() >= 0.0


def test_a_quantised_cloud_beside_it(context: metaros.Context) -> None:
    with lidar_and(context, quantized_step_m=0.02) as (driver, send):
        clouds = driver.messages(PointCloud2, "points")
        small = driver.messages(QuantizedCloud, "points/quantized")
        with turning(Vlp16Emulator(), send):
            seen(small)
            wait_until(lambda: any(one.header == two.header for one in clouds for two in small))
        one, two = next((one, two) for one in clouds for two in small if one.header == two.header)
        exact, rough = points_to_numpy(one), quantized_to_numpy(two)
        assert max(np.abs(exact[name] - rough[name]).max() for name in "xyz") <= 0.0101
        assert (exact["intensity"] == rough["intensity"]).all()
        assert len(two.data) < len(one.data) / 3


def test_all_turns_come_in_order_with_delivery_all(context: metaros.Context) -> None:
    with lidar_and(context, delivery="all") as (driver, send):
        clouds = driver.messages(PointCloud2, "points", qos_reliable_all)
        emulator = Vlp16Emulator()
        with turning(emulator, send, pause_s=0.005):
            seen(clouds, 6)
        counters = driver.node.status.counters
        assert counters["dropped_turns"] == 0
        stamps = [one.header.stamp.sec * 10**9 + one.header.stamp.nanosec for one in clouds]
        assert stamps == sorted(stamps)
        assert np.diff(stamps).min() > 50_000_000


def test_with_delivery_latest_a_slow_reader_gets_the_newest() -> None:
    context = _QuietContext()
    receiver = Receiver(context, bind="127.0.0.1", port=0, position_port=0, device="", newest_only=True)  # type: ignore[arg-type]
    try:
        with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as wire:
            emulator = Vlp16Emulator()
            with turning(emulator, lambda data: wire.sendto(data, ("127.0.0.1", receiver.port))):
                wait_until(lambda: context.counters.get("skipped_turns", 0) >= 3)
        newest = receiver.take(1.0)
        assert newest is not None
        assert receiver.take(0.0) is None
    finally:
        receiver.close()


class _QuietContext:
    """The part of a unit that a receiver needs."""

    def __init__(self) -> None:
        self.clock = SystemClock()
        self.counters: dict[str, int] = {}
        self.facts: dict[str, str] = {}

    def heard(self, data: bytes) -> bytes:
        return data

    def count(self, name: str, by: int = 1) -> None:
        self.counters[name] = self.counters.get(name, 0) + by

    def fact(self, name: str, value: object) -> None:
        self.facts[name] = str(value)


def test_garbage_and_losses_are_counted(context: metaros.Context) -> None:
    noise = np.random.default_rng(16)
    with lidar_and(context) as (driver, send):
        clouds = driver.messages(PointCloud2, "points")
        emulator = Vlp16Emulator()
        for size in (0, 1, 100, 1205, 1206, 1207, 1500, 9000):
            send(noise.integers(0, 256, size, dtype=np.uint8).tobytes())
        send(b"\0" + emulator.packet()[1:])
        send(emulator.packet()[:1205] + b"\x28")
        for _ in range(5):
            send(emulator.packet())
        for _ in range(7):
            emulator.packet()
        with turning(emulator, send):
            assert_room(points_to_numpy(seen(clouds)))
        counters = driver.node.status.counters
        assert counters["wrong_size"] == 7
        assert counters["wrong_magic"] == 2
        assert counters["wrong_product"] == 1
        assert counters["lost_packets"] >= 7


def test_a_megabyte_of_noise_then_a_room(context: metaros.Context) -> None:
    noise = np.random.default_rng(7).integers(0, 256, 1 << 20, dtype=np.uint8).tobytes()
    with lidar_and(context) as (driver, send):
        clouds = driver.messages(PointCloud2, "points")
        for at in range(0, len(noise), 1206):
            send(noise[at : at + 1206])
        with turning(Vlp16Emulator(), send):
            assert_room(points_to_numpy(seen(clouds)))
        assert driver.node.status.counters["wrong_magic"] > 100


def test_packets_of_others_do_not_count(context: metaros.Context) -> None:
    with lidar_and(context, device="192.0.2.7") as (driver, send):
        clouds = driver.messages(PointCloud2, "points")
        with turning(Vlp16Emulator(), send):
            wait_until(lambda: driver.node.status.counters["foreign_packets"] > 100)
        assert clouds == []


def test_gps_and_pps_are_reported(context: metaros.Context) -> None:
    port = free_port()
    with lidar_and(context, position_port=port) as (driver, _), socket.socket(type=socket.SOCK_DGRAM) as wire:
        wire.sendto(position_packet(5, 2), ("127.0.0.1", port))
        wire.sendto(b"short", ("127.0.0.1", port))
        wait_until(lambda: driver.facts().get("pps") == "locked" and driver.facts().get("wrong_position") == "1")
        assert driver.facts()["gps"] == "valid"
        assert driver.facts()["gps_utc"] == "231126 120304"


def test_silence_is_stale_and_the_lidar_comes_back(context: metaros.Context) -> None:
    with lidar_and(context) as (driver, send):
        clouds = driver.messages(PointCloud2, "points")
        with turning(Vlp16Emulator(), send):
            seen(clouds)
        wait_until(lambda: driver.state() == "stale" or driver.leap(1.0))
        with turning(Vlp16Emulator(), send):
            seen(clouds)
            wait_until(lambda: driver.state() == "working")


def test_a_port_that_is_taken_is_waited_for(context: metaros.Context) -> None:
    with socket.socket(type=socket.SOCK_DGRAM) as taken:
        taken.bind(("127.0.0.1", 0))
        port = taken.getsockname()[1]
        with running("vlp16", {"port": port}, context=context) as driver:
            wait_until(lambda: driver.state() == "waiting")
            taken.close()
            wait_until(lambda: driver.node.status.detail.startswith("listening"))


@pytest.mark.parametrize(
    ("parameters", "words"),
    [
        ({"bind": "everywhere"}, "no IP address"),
        ({"device": "my lidar"}, "no IP address"),
        ({"range_min_m": 50.0, "range_max_m": 2.0}, "range_min_m must be below"),
        ({"z_min_m": 2.0, "z_max_m": 1.0}, "z_min_m below z_max_m"),
    ],
)
def test_what_cannot_work_is_refused(context: metaros.Context, parameters: dict[str, Any], words: str) -> None:
    with running("vlp16", {"port": 0, **parameters}, context=context, start=False) as driver:
        with pytest.raises(ConfigError, match=words):
            driver.node.start()
