"""Take over a simulated robot, drive a square of one metre with it, and give it back to its autopilot.

    metaros up            # or: metaros router & metaros sim
    python examples/drive_square.py [ROBOT]

Commands are sent at 10 Hz: a robot's base stops by itself 300 ms after the last one. Corners are turned by odometry.
"""

from __future__ import annotations

import math
import sys
import threading

import metaros
from metaros.interfaces.geometry_msgs.msg import Twist
from metaros.interfaces.nav_msgs.msg import Odometry
from metaros.interfaces.std_srvs.srv import Trigger

SIDE_M, SPEED_M_S, TURN_RAD_S, PERIOD_S = 1.0, 0.8, 1.5, 0.1
PATIENCE = 60  # commands a leg, after which something must be in the way


class Square:
    """Four sides and four left turns, each ended by what odometry says."""

    def __init__(self, robot: str) -> None:
        self.done = threading.Event()
        self.pose: tuple[float, float, float] | None = None
        self.start: tuple[float, float, float] | None = None
        self.sent = 0
        self.legs = ["side", "turn"] * 4
        self.node = metaros.Node("drive_square")
        self.command = self.node.create_publisher(Twist, f"/{robot}/cmd_vel", 10)
        self.node.create_subscription(Odometry, f"/{robot}/odom", self.on_odometry, 10)
        self.node.create_timer(PERIOD_S, self.drive)

    def on_odometry(self, message: Odometry) -> None:
        position, turn = message.pose.pose.position, message.pose.pose.orientation
        self.pose = (position.x, position.y, 2.0 * math.atan2(turn.z, turn.w))

    def drive(self) -> None:
        if self.pose is None or self.done.is_set():
            return
        if self.start is None:
            self.start = self.pose
        self.sent += 1
        left = self.left()
        if left <= 0.03 or self.sent > PATIENCE:
            print(f"{self.legs.pop(0)} ended at x={self.pose[0]:.2f} y={self.pose[1]:.2f}", flush=True)
            self.start, self.sent = self.pose, 0
            left = self.left()
        twist = Twist()
        if not self.legs:
            self.done.set()
        elif self.legs[0] == "side":
            twist.linear.x = min(SPEED_M_S, 0.1 + 2.5 * left)  # slower towards the end, so as not to overshoot
        else:
            twist.angular.z = min(TURN_RAD_S, 0.1 + 2.5 * left)
        self.command.publish(twist)

    def left(self) -> float:
        """Metres or radians to the end of this leg."""
        assert self.pose is not None
        assert self.start is not None
        if self.legs and self.legs[0] == "side":
            return SIDE_M - math.dist(self.pose[:2], self.start[:2])
        return math.pi / 2 - math.remainder(self.pose[2] - self.start[2], math.tau)


def main() -> None:
    robot = sys.argv[1] if len(sys.argv) > 1 else "sim_1"
    square = Square(robot)
    resume = square.node.create_client(Trigger, f"/{robot}/base/resume")
    executor = metaros.SingleThreadedExecutor()
    executor.add_node(square.node)
    while not square.done.is_set():
        executor.spin_once(timeout_s=0.2)
    threading.Event().wait(0.5)  # the base's watchdog stops the robot; only then may it be given back
    print("square driven:", resume.call(Trigger.Request(), timeout_s=5.0).message)
    executor.shutdown()
    square.node.close()


if __name__ == "__main__":
    main()
