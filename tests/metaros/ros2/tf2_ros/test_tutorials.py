"""What the tf2 tutorials do, typed anew: a turtle that follows another, by the names that ROS 2 programs import."""

from __future__ import annotations

import importlib
import math
import threading
from typing import Any

import pytest

from metaros.ros2.rclpy.core.context import Context
from tests.support.waiting import wait_until

RULES = ["--ros-args", "-r", "/tf:=/turtles/tf", "-r", "/tf_static:=/turtles/tf_static"]
QUIET = {"start_parameter_services": False, "enable_rosout": False, "cli_args": RULES}


@pytest.mark.usefixtures("ros2_names")
def test_names_are_where_programs_look_for_them() -> None:
    named = {
        "ament_index_python": ["get_package_share_directory"],
        "ament_index_python.packages": ["get_package_prefix", "get_package_share_path", "PackageNotFoundError"],
        "ament_index_python.resources": ["get_resource", "get_resources", "has_resource"],
        "ament_index_python.search_paths": ["get_search_paths"],
        "cv_bridge": ["CvBridge", "CvBridgeError"],
        "cv_bridge.core": ["CvBridge"],
        "message_filters": ["Subscriber", "Cache", "TimeSynchronizer", "ApproximateTimeSynchronizer", "SimpleFilter"],
        "sensor_msgs_py": ["point_cloud2"],
        "sensor_msgs_py.numpy_compat": ["structured_to_unstructured", "unstructured_to_structured"],
        "sensor_msgs_py.point_cloud2": ["read_points", "read_points_numpy", "read_points_list", "create_cloud"],
        "tf2_geometry_msgs": ["do_transform_point", "do_transform_pose", "do_transform_vector3"],
        "tf2_geometry_msgs.tf2_geometry_msgs": ["do_transform_pose_stamped"],
        "tf2_py": ["BufferCore", "TransformException", "LookupException", "TimeoutException"],
        "tf2_ros": ["Buffer", "TransformListener", "TransformException", "TypeException", "BufferClient", "convert"],
        "tf2_ros.buffer": ["Buffer"],
        "tf2_ros.buffer_client": ["BufferClient"],
        "tf2_ros.buffer_interface": ["BufferInterface", "TransformRegistration"],
        "tf2_ros.static_transform_broadcaster": ["StaticTransformBroadcaster"],
        "tf2_ros.static_transform_listener": ["StaticTransformListener"],
        "tf2_ros.transform_broadcaster": ["TransformBroadcaster"],
        "tf2_ros.transform_listener": ["TransformListener"],
        "tf2_sensor_msgs": ["do_transform_cloud", "transform_points"],
    }
    missing: list[str] = []
    for module, names in named.items():
        loaded = importlib.import_module(module)
        missing += [name for name in names if not hasattr(loaded, name) and not _is_module(f"{module}.{name}")]
    assert missing == []


def _is_module(name: str) -> bool:
    try:
        importlib.import_module(name)
    except ModuleNotFoundError:
        return False
    return True


@pytest.mark.usefixtures("ros2_names")
def test_a_turtle_follows_another(rclpy_context: Context) -> None:
    import rclpy  # type: ignore[import-not-found]
    from geometry_msgs.msg import TransformStamped, Twist  # type: ignore[import-not-found]
    from rclpy.executors import SingleThreadedExecutor  # type: ignore[import-not-found]
    from rclpy.node import Node  # type: ignore[import-not-found]
    from tf2_ros import TransformBroadcaster, TransformException  # type: ignore[import-not-found]
    from tf2_ros.buffer import Buffer  # type: ignore[import-not-found]
    from tf2_ros.static_transform_broadcaster import StaticTransformBroadcaster  # type: ignore[import-not-found]
    from tf2_ros.transform_listener import TransformListener  # type: ignore[import-not-found]

    class Turtles(Node):  # type: ignore[misc]
        """Tells where two turtles are, and a carrot beside the first."""

        def __init__(self) -> None:
            super().__init__("turtles", context=rclpy_context, **QUIET)
            self.tf_broadcaster = TransformBroadcaster(self)
            self.static_broadcaster = StaticTransformBroadcaster(self)
            carrot = TransformStamped()
            carrot.header.stamp = self.get_clock().now().to_msg()
            carrot.header.frame_id, carrot.child_frame_id = "turtle1", "carrot1"
            carrot.transform.translation.y = 2.0
            self.static_broadcaster.sendTransform(carrot)
            self.timer = self.create_timer(0.005, self.tell)

        def tell(self) -> None:
            now = self.get_clock().now().to_msg()
            told = []
            for name, x, theta in (("turtle1", 3.0, math.pi / 2), ("turtle2", -1.0, 0.0)):
                t = TransformStamped()
                t.header.stamp = now
                t.header.frame_id, t.child_frame_id = "world", name
                t.transform.translation.x = x
                t.transform.rotation.z, t.transform.rotation.w = math.sin(theta / 2), math.cos(theta / 2)
                told.append(t)
            self.tf_broadcaster.sendTransform(told)

    class Follower(Node):  # type: ignore[misc]
        """Drives the second turtle to where the carrot was a moment ago, and waits for a frame that comes later."""

        def __init__(self) -> None:
            super().__init__("follower", context=rclpy_context, **QUIET)
            self.target_frame = self.declare_parameter("target_frame", "carrot1").get_parameter_value().string_value
            self.tf_buffer = Buffer()
            self.tf_listener = TransformListener(self.tf_buffer, self)
            self.publisher = self.create_publisher(Twist, "turtle2/cmd_vel", 1)
            self.timer = self.create_timer(0.005, self.on_timer)
            self.sent: list[Any] = []
            self.failed: list[Exception] = []
            self.ready: list[Any] = []
            self.tf_future = self.tf_buffer.wait_for_transform_async("world", "carrot2", rclpy.time.Time())
            self.tf_future.add_done_callback(lambda future: self.ready.append(future.result()))

        def on_timer(self) -> None:
            now = self.get_clock().now()
            past = now - rclpy.duration.Duration(seconds=0.05)
            try:
                t = self.tf_buffer.lookup_transform("turtle2", self.target_frame, rclpy.time.Time())
                self.tf_buffer.lookup_transform_full(
                    target_frame="turtle2",
                    target_time=rclpy.time.Time(),
                    source_frame=self.target_frame,
                    source_time=past,
                    fixed_frame="world",
                    timeout=rclpy.duration.Duration(seconds=0.0),
                )
            except TransformException as error:
                self.failed.append(error)
                return
            twist = Twist()
            twist.angular.z = math.atan2(t.transform.translation.y, t.transform.translation.x)
            twist.linear.x = 0.5 * math.hypot(t.transform.translation.x, t.transform.translation.y)
            self.publisher.publish(twist)
            self.sent.append(twist)

    turtles, follower = Turtles(), Follower()
    executor = SingleThreadedExecutor(context=rclpy_context)
    executor.add_node(turtles)
    executor.add_node(follower)
    thread = threading.Thread(target=executor.spin)
    thread.start()
    try:
        wait_until(lambda: len(follower.sent) > 2)
        assert (follower.sent[-1].linear.x, follower.sent[-1].angular.z) == pytest.approx((1.0, 0.0), abs=1e-9)
        assert follower.failed, "before the frames were there, or as far back"
        assert not follower.ready
        late = TransformStamped()
        late.header.frame_id, late.child_frame_id = "turtle2", "carrot2"
        turtles.static_broadcaster.sendTransform(late)
        wait_until(lambda: bool(follower.ready))
        assert follower.ready[0].transform.translation.x == -1.0
    finally:
        executor.shutdown()
        thread.join()
        turtles.destroy_node()
        follower.destroy_node()
