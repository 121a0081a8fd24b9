"""A program for ROS 2, not changed for Meta-ROS: run it by `metaros ros2 run examples/ros2/talker.py`."""

import rclpy
from rclpy.executors import ExternalShutdownException
from rclpy.node import Node
from std_msgs.msg import String


class Talker(Node):
    def __init__(self):
        super().__init__("talker")
        self.declare_parameter("word", "Hello")
        self.publisher_ = self.create_publisher(String, "chatter", 10)
        self.timer = self.create_timer(0.5, self.talk)
        self.i = 0

    def talk(self):
        self.i += 1
        message = String(data=f"{self.get_parameter('word').value} {self.i}")
        self.publisher_.publish(message)
        self.get_logger().info(f'Publishing: "{message.data}"')


def main(args=None):
    try:
        with rclpy.init(args=args):
            rclpy.spin(Talker())
    except (KeyboardInterrupt, ExternalShutdownException):
        pass


if __name__ == "__main__":
    main()
