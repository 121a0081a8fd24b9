"""Programs for ROS 2 as rows of a launch table: supervised like all others."""

from __future__ import annotations

import os
import signal
from pathlib import Path

import pytest

from tests.metaros.cli.launch.test_commands import launcher

TALKER = """
    import os
    import sys

    import rclpy
    from rclpy.node import Node
    from std_msgs.msg import String


    class Talker(Node):
        def __init__(self):
            super().__init__("anything")
            word = self.declare_parameter("word", "nothing").value
            publisher = self.create_publisher(String, "chatter", 10)
            print(f"pid={os.getpid()} {self.get_fully_qualified_name()} {publisher.topic_name} {word}", sys.argv[1])


    def main():
        rclpy.init(args=sys.argv)
        try:
            rclpy.spin(Talker())
        except (KeyboardInterrupt, rclpy.executors.ExternalShutdownException):
            print("goes")


    if __name__ == "__main__":
        main()
"""


@pytest.mark.integration
def test_a_file_and_an_executable_are_started_named_remapped_restarted_and_stopped(tmp_path: Path) -> None:
    table = """
        spare = false
        heartbeat_s = 0.4
        [[node]]
        name = "talker"
        ros2 = "talker.py"
        args = ["one"]
        namespace = "/r"
        parameters = { word = "hello" }
        remap = { chatter = "talk" }
        restart = { base_delay_s = 0.0, max_delay_s = 0.0 }
        [[node]]
        name = "second"
        ros2 = "my_robot talk"
        args = ["two"]
        after = ["talker"]
    """
    package = tmp_path / "src" / "my_robot"
    (package / "my_robot").mkdir(parents=True)
    (package / "package.xml").write_text("<package><name>my_robot</name></package>")
    (package / "setup.cfg").write_text("[options.entry_points]\nconsole_scripts =\n    talk = my_robot.talk:main\n")
    (package / "my_robot" / "talk.py").write_text("import talker\nmain = talker.main\n")
    with launcher(tmp_path, table, talker=TALKER) as running:
        running.logged("talker", "/r/talker /r/talk hello one")
        running.logged("second", "/second /chatter nothing two")
        os.kill(running.pid("talker"), signal.SIGKILL)
        running.logged("talker", "/r/talker /r/talk hello one", times=2)
        assert "hung" not in running.text()
        assert running.end() == 0
        for name in ("talker", "second"):
            assert "goes" in (tmp_path / "logs" / f"{name}.log").read_text()
