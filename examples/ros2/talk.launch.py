"""A launch file for ROS 2: `metaros ros2 launch examples/ros2/talk.launch.py word:=Bonjour`."""

from pathlib import Path

from launch import LaunchDescription
from launch.actions import DeclareLaunchArgument
from launch.substitutions import LaunchConfiguration
from launch_ros.actions import Node

HERE = Path(__file__).parent


def generate_launch_description():
    word = LaunchConfiguration("word")
    return LaunchDescription(
        [
            DeclareLaunchArgument("word", default_value="Hello", description="what the talker says"),
            Node(executable=str(HERE / "talker.py"), namespace="robot", parameters=[{"word": word}], output="screen"),
            Node(executable=str(HERE / "listener.py"), namespace="robot", output="screen"),
        ]
    )
