"""Driving a simulated robot through gateway and agent, and what happens when either dies while it moves."""

from __future__ import annotations

import json
import threading
import time
from collections.abc import Iterator
from contextlib import ExitStack, closing

import pytest
from websockets.exceptions import ConnectionClosed
from websockets.sync.client import ClientConnection

import metaros
from metaros.interfaces.nav_msgs.msg import Odometry
from tests.support.gateways.viewer import open_socket
from tests.support.processes.stack import Stack
from tests.support.waiting import wait_until

MOVING, STILL = 0.1, 0.01
SLOW = 20  # how much longer all may take on a loaded machine; the promises themselves are measured on a quiet one


class Speedometer:
    """What the robot itself says of its motion, read from Zenoh past agent and gateway."""

    def __init__(self, zenoh_port: int) -> None:
        self.context = metaros.Context(connect=f"tcp/127.0.0.1:{zenoh_port}")
        self.node = metaros.Node("speedometer", context=self.context)
        self.node.create_subscription(Odometry, "/sim_1/odom", self.heard, metaros.qos_sensor_data)
        self.log: list[tuple[float, float]] = []
        self.executor = metaros.SingleThreadedExecutor()
        self.executor.add_node(self.node)
        self.thread = threading.Thread(target=self.executor.spin)
        self.thread.start()

    def heard(self, message: Odometry) -> None:
        self.log.append((time.monotonic(), abs(message.twist.twist.linear.x)))

    def speed(self) -> float:
        return self.log[-1][1] if self.log else 0.0

    def stopped_after(self, since: float) -> float:
        """Seconds from `since` to the first of the samples that stay still."""
        later = [(stamp, speed) for stamp, speed in self.log if stamp >= since]
        moving = [stamp for stamp, speed in later if speed > STILL]
        return (max(moving) - since) if moving else 0.0

    def close(self) -> None:
        self.executor.shutdown()
        self.thread.join(60)
        self.node.close()
        self.context.close()


class Driver:
    """A browser's hold-to-drive: 10 Hz while held."""

    def __init__(self, stack: Stack) -> None:
        self.opened = ExitStack()
        # Nobody reads what it is told: in a queue that is full the end would be waited for.
        connection = open_socket(stack.url, "/api/v1/robots/sim_1/teleop", key=stack.key, max_queue=None)
        self.socket: ClientConnection = self.opened.enter_context(connection)
        wait_until(self.take)  # who drove before has just gone
        self.seq = 0
        self.held = threading.Event()
        self.ended = threading.Event()
        self.thread = threading.Thread(target=self.send_while_held)
        self.thread.start()

    def take(self) -> bool:
        self.socket.send(json.dumps({"op": "take", "holder": "test"}))
        return bool(json.loads(self.socket.recv(timeout=60))["op"] == "granted")

    def send(self) -> None:
        self.seq += 1
        self.socket.send(json.dumps({"op": "drive", "linear": 0.4, "angular": 0.0, "seq": self.seq}))

    def send_while_held(self) -> None:
        while not self.ended.wait(0.1):
            if self.held.is_set():
                try:
                    self.send()
                except ConnectionClosed:  # the gateway was killed
                    return

    def release(self) -> None:
        self.held.clear()
        self.socket.send(json.dumps({"op": "stop"}))

    def close(self) -> None:
        self.ended.set()
        self.thread.join(60)
        self.opened.close()


@pytest.fixture(scope="module")
def robot(tmp_path_factory: pytest.TempPathFactory) -> Iterator[tuple[Stack, Speedometer]]:
    """A simulated robot, its agent and a gateway, for all of these tests; who kills one of them starts it again."""
    with Stack(tmp_path_factory.mktemp("robot")) as stack:
        stack.router()
        stack.at_once(
            stack.gateway,
            lambda: stack.sim("--resume-after", "600", "--seed", "1", "--no-camera"),
            lambda: stack.agent("sim_1"),
        )
        wait_until(lambda: "/sim_1/cmd_vel" in stack.topics("sim_1") or stack.online() == {"sim_1"}, timeout_s=60)
        with closing(Speedometer(stack.zenoh_port)) as speedometer:
            yield stack, speedometer


@pytest.fixture
def driven(robot: tuple[Stack, Speedometer]) -> Iterator[tuple[Stack, Driver, Speedometer]]:
    stack, speedometer = robot
    with closing(Driver(stack)) as driver:
        # The first zero command takes the robot out of autonomy; it must stand before a test makes it move.
        driver.release()
        wait_until(lambda: speedometer.log and speedometer.speed() < STILL, timeout_s=60)
        yield stack, driver, speedometer


def drive(driver: Driver, speedometer: Speedometer) -> None:
    """Hold until the robot moves."""
    driver.held.set()
    wait_until(lambda: speedometer.speed() > MOVING, timeout_s=60)


def assert_stays_stopped(speedometer: Speedometer, *, since: float, within_s: float) -> None:
    """Still within the deadline, and still a second later."""
    wait_until(lambda: speedometer.speed() < STILL)
    still = time.monotonic()
    wait_until(lambda: time.monotonic() - still > 1.0 and len([at for at, _ in speedometer.log if at > still]) > 10)
    assert speedometer.stopped_after(still) == 0.0
    assert speedometer.stopped_after(since) < SLOW * within_s


def test_odometry_answers_a_command(driven: tuple[Stack, Driver, Speedometer]) -> None:
    _stack, driver, speedometer = driven
    delays_s = []
    for _ in range(3):
        sent = time.monotonic()
        driver.held.set()
        driver.send()
        wait_until(lambda: speedometer.speed() > STILL, timeout_s=60, every_s=0.001)
        delays_s.append(time.monotonic() - sent)
        driver.release()
        wait_until(lambda: speedometer.speed() < STILL, timeout_s=60)
    print("command to odometry, ms:", [round(delay * 1000) for delay in delays_s])
    assert sorted(delays_s)[1] < SLOW * 0.2, delays_s


def test_release_stops_the_robot(driven: tuple[Stack, Driver, Speedometer]) -> None:
    _stack, driver, speedometer = driven
    drive(driver, speedometer)
    driver.release()
    assert_stays_stopped(speedometer, since=time.monotonic(), within_s=0.5)


@pytest.mark.parametrize("victim", ["gateway", "agent-sim_1"])
def test_kill_while_driving_stops_the_robot(driven: tuple[Stack, Driver, Speedometer], victim: str) -> None:
    stack, driver, speedometer = driven
    drive(driver, speedometer)
    program = next(program for program in stack.programs if program.name == victim)
    program.kill()
    assert_stays_stopped(speedometer, since=time.monotonic(), within_s=0.5)
    stack.restart(program)
    wait_until(lambda: stack.online() == {"sim_1"})  # a killed gateway's robots come back by themselves
