"""What the demos' programs of quality of service do, typed anew, and those of topics that are no mere text."""

from __future__ import annotations

import re
from collections.abc import Callable
from typing import Any

import pytest

pytestmark = pytest.mark.usefixtures("rclpy_program")


def spin_until(executor: Any, condition: Callable[[], object], *, turns: int = 3000) -> None:
    """Spin until it is so."""
    for _ in range(turns):
        if condition():
            return
        executor.spin_once(timeout_sec=0.02)
    raise AssertionError("not so for a minute")


@pytest.fixture
def pair(rclpy_program: None) -> Any:
    """A talker, a listener, and who spins them."""
    import rclpy
    from rclpy.executors import SingleThreadedExecutor

    rclpy.init()
    executor = SingleThreadedExecutor()
    nodes = [rclpy.create_node(name) for name in ("qos_talker", "qos_listener")]
    for node in nodes:
        executor.add_node(node)
    return executor, *nodes


def test_a_deadline_is_missed_while_the_talker_pauses(pair: Any) -> None:
    from rclpy.duration import Duration
    from rclpy.event_handler import PublisherEventCallbacks, SubscriptionEventCallbacks
    from rclpy.qos import QoSProfile
    from std_msgs.msg import String

    executor, talker, listener = pair
    profile = QoSProfile(depth=10, deadline=Duration(seconds=0.06))
    missed: dict[str, list[int]] = {"talker": [], "listener": []}
    heard: list[str] = []
    callbacks = SubscriptionEventCallbacks(deadline=lambda event: missed["listener"].append(event.total_count))
    listener.create_subscription(String, "deadline", lambda m: heard.append(m.data), profile, event_callbacks=callbacks)
    publisher = talker.create_publisher(
        String,
        "deadline",
        profile,
        event_callbacks=PublisherEventCallbacks(deadline=lambda event: missed["talker"].append(event.total_count)),
    )
    publisher.publish(String(data="before"))
    spin_until(executor, lambda: heard and all(missed.values()))
    publisher.publish(String(data="after"))
    spin_until(executor, lambda: len(heard) == 2)
    assert missed["talker"][0] >= 1  # more where the machine was late
    assert missed["listener"][0] >= 1


def test_what_does_not_fit_is_told_at_both_ends(pair: Any) -> None:
    from rclpy.duration import Duration
    from rclpy.event_handler import PublisherEventCallbacks, SubscriptionEventCallbacks
    from rclpy.qos import QoSDurabilityPolicy, QoSLivelinessPolicy, QoSPolicyKind, QoSProfile, QoSReliabilityPolicy
    from std_msgs.msg import String

    executor, talker, listener = pair
    offered_and_requested = {
        "durability": (QoSDurabilityPolicy.VOLATILE, QoSDurabilityPolicy.TRANSIENT_LOCAL),
        "deadline": (Duration(seconds=2), Duration(seconds=1)),
        "liveliness": (QoSLivelinessPolicy.AUTOMATIC, QoSLivelinessPolicy.MANUAL_BY_TOPIC),
        "reliability": (QoSReliabilityPolicy.BEST_EFFORT, QoSReliabilityPolicy.RELIABLE),
    }
    told: dict[str, Any] = {}
    for policy, (offered, requested) in offered_and_requested.items():
        profiles = [QoSProfile(depth=10) for _ in range(2)]
        for profile, value in zip(profiles, (offered, requested), strict=True):
            setattr(profile, policy, value)

        def note(event: Any, end: str, policy: str = policy) -> None:
            told[f"{policy} {end}"] = (event.total_count, event.total_count_change, event.last_policy_kind)

        pub = PublisherEventCallbacks(incompatible_qos=lambda event, note=note: note(event, "offered"))
        sub = SubscriptionEventCallbacks(incompatible_qos=lambda event, note=note: note(event, "requested"))
        talker.create_publisher(String, f"misfit_{policy}", profiles[0], event_callbacks=pub)
        listener.create_subscription(String, f"misfit_{policy}", print, profiles[1], event_callbacks=sub)
    spin_until(executor, lambda: len(told) == 8)
    for policy in offered_and_requested:
        kind = QoSPolicyKind[policy.upper()]
        assert told[f"{policy} offered"] == told[f"{policy} requested"] == (1, 1, kind)


def test_late_listeners_hear_what_has_not_expired(pair: Any) -> None:
    from rclpy.duration import Duration
    from rclpy.qos import QoSDurabilityPolicy, QoSProfile, QoSReliabilityPolicy
    from std_msgs.msg import String

    executor, talker, listener = pair
    policies = {"reliability": QoSReliabilityPolicy.RELIABLE, "durability": QoSDurabilityPolicy.TRANSIENT_LOCAL}
    heard: dict[str, list[str]] = {"short": [], "long": []}
    for name, lifespan_s in (("short", 0.015), ("long", 60.0)):
        profile = QoSProfile(depth=10, lifespan=Duration(seconds=lifespan_s), **policies)
        publisher = talker.create_publisher(String, f"kept_{name}", profile)
        publisher.publish(String(data="old"))
        talker.get_clock().sleep_for(Duration(seconds=0.03))
        callback = heard[name].append
        listener.create_subscription(String, f"kept_{name}", lambda message, add=callback: add(message.data), profile)
        spin_until(executor, lambda publisher=publisher: publisher.get_subscription_count() == 1)
        again = talker.create_timer(0.002, lambda publisher=publisher: publisher.publish(String(data="new")))
        spin_until(executor, lambda name=name: "new" in heard[name])  # one of them is not late, on any machine
        talker.destroy_timer(again)
    assert {name: [*dict.fromkeys(texts)] for name, texts in heard.items()} == {
        "short": ["new"],
        "long": ["old", "new"],
    }


def test_a_talker_that_comes_falls_silent_and_goes(pair: Any) -> None:
    from rclpy.duration import Duration
    from rclpy.event_handler import PublisherEventCallbacks, SubscriptionEventCallbacks
    from rclpy.qos import QoSLivelinessPolicy, QoSProfile
    from std_msgs.msg import String

    executor, talker, listener = pair
    lease = {"liveliness": QoSLivelinessPolicy.MANUAL_BY_TOPIC, "liveliness_lease_duration": Duration(seconds=0.06)}
    profile = QoSProfile(depth=10, **lease)
    told: list[tuple[int, int]] = []
    lost: list[int] = []
    callbacks = SubscriptionEventCallbacks(
        liveliness=lambda event: told.append((event.alive_count, event.not_alive_count))
    )
    listener.create_subscription(String, "alive", print, profile, event_callbacks=callbacks)
    of_publisher = PublisherEventCallbacks(liveliness=lambda event: lost.append(event.total_count))
    publisher = talker.create_publisher(String, "alive", profile, event_callbacks=of_publisher)
    publisher.assert_liveliness()
    spin_until(executor, lambda: (1, 0) in told)
    spin_until(executor, lambda: (0, 1) in told and lost)
    assert lost[0] == 1
    executor.remove_node(talker)
    talker.destroy_node()
    spin_until(executor, lambda: told[-1] == (0, 0))


def test_matches_are_counted_at_both_ends(pair: Any) -> None:
    from example_interfaces.msg import String
    from rclpy.event_handler import (
        PublisherEventCallbacks,
        QoSPublisherMatchedInfo,
        QoSSubscriptionMatchedInfo,
        SubscriptionEventCallbacks,
    )
    from rclpy.task import Future

    executor, detector, other = pair
    told: list[tuple[int, int]] = []
    pending: list[Any] = []

    def matched(info: QoSPublisherMatchedInfo | QoSSubscriptionMatchedInfo) -> None:
        told.append((info.current_count, info.current_count_change))
        pending.pop().set_result(True)

    def after(call: Callable[[], Any]) -> Any:
        pending.append(Future())
        future, made = pending[-1], call()
        executor.spin_until_future_complete(future, 30)
        return made

    detector.create_publisher(String, "pub_side", 10, event_callbacks=PublisherEventCallbacks(matched=matched))
    callbacks = SubscriptionEventCallbacks(matched=matched)
    detector.create_subscription(String, "sub_side", lambda msg: None, 10, event_callbacks=callbacks)
    for make, destroy, topic in (
        (lambda topic: other.create_subscription(String, topic, print, 10), other.destroy_subscription, "pub_side"),
        (lambda topic: other.create_publisher(String, topic, 10), other.destroy_publisher, "sub_side"),
    ):
        made = [after(lambda make=make, topic=topic: make(topic)) for _ in range(2)]
        for entity in made:
            after(lambda destroy=destroy, entity=entity: destroy(entity))
    assert told == [(1, 1), (2, 1), (1, -1), (0, -1)] * 2


def test_profiles_that_the_command_line_overrides(monkeypatch: pytest.MonkeyPatch) -> None:
    import rclpy
    from rclpy.qos_overriding_options import InvalidQosOverridesError, QosCallbackResult, QoSOverridingOptions
    from std_msgs.msg import String

    def shallow(qos: Any) -> Any:
        result = QosCallbackResult()
        result.successful = qos.depth <= 10
        result.reason = "" if result.successful else "too deep"
        return result

    prefix = "qos_overrides./chatter.publisher"
    words = ["program", "--ros-args", "-p", f"{prefix}.depth:=7", "-p", f"{prefix}.reliability:=best_effort"]
    monkeypatch.setattr("sys.argv", [*words, "-p", "qos_overrides./chatter.subscription.depth:=12"])
    options = QoSOverridingOptions.with_default_policies(callback=shallow)
    with rclpy.init():
        node = rclpy.create_node("qos_overrides_talker")
        publisher = node.create_publisher(String, "chatter", 10, qos_overriding_options=options)
        assert publisher.qos_profile.depth == node.get_parameter(f"{prefix}.depth").value == 7
        assert publisher.qos_profile.reliability is rclpy.qos.ReliabilityPolicy.BEST_EFFORT
        with pytest.raises(InvalidQosOverridesError, match="too deep"):
            node.create_subscription(String, "chatter", print, 10, qos_overriding_options=options)


def test_bytes_acknowledgements_and_a_cloud(pair: Any) -> None:
    import numpy as np
    from rclpy.duration import Duration
    from rclpy.serialization import deserialize_message
    from sensor_msgs.msg import PointCloud2, PointField
    from sensor_msgs_py import point_cloud2
    from std_msgs.msg import Header, String

    executor, talker, listener = pair
    heard: list[Any] = []
    listener.create_subscription(String, "chatter", heard.append, 10, raw=True)
    publisher = talker.create_publisher(String, "chatter", 10)
    publisher.publish(String(data="Hello World: 0"))
    assert publisher.wait_for_all_acked(Duration(seconds=3))
    spin_until(executor, lambda: heard)
    assert heard == [b"\x00\x01\x00\x00\x0f\x00\x00\x00Hello World: 0\x00"]
    assert deserialize_message(heard[0], String).data == "Hello World: 0"

    clouds: list[Any] = []
    listener.create_subscription(PointCloud2, "test_cloud", clouds.append, 10)
    fields = [
        PointField(name=name, offset=4 * index, datatype=PointField.FLOAT32, count=1)
        for index, name in enumerate(("x", "y", "z", "intensity"))
    ]
    x, y = np.meshgrid(np.linspace(-2, 2, 10), np.linspace(-2, 2, 10))
    points = np.array([x, y, x * y, x * y]).reshape(4, -1).T
    header = Header(frame_id="map", stamp=talker.get_clock().now().to_msg())
    talker.create_publisher(PointCloud2, "test_cloud", 10).publish(point_cloud2.create_cloud(header, fields, points))
    spin_until(executor, lambda: clouds)
    assert (clouds[0].width, clouds[0].height, clouds[0].header) == (100, 1, header)
    assert np.allclose(point_cloud2.read_points_numpy(clouds[0]), points)


def test_a_camera_and_its_calibration_come_together(pair: Any) -> None:
    import message_filters
    from rclpy.qos import qos_profile_sensor_data
    from sensor_msgs.msg import CameraInfo, Image

    executor, camera, viewer = pair
    kinds = {"image_raw": Image, "camera_info": CameraInfo}
    found: dict[str, list[Any]] = {"exact": [], "near": []}
    heard = [
        message_filters.Subscriber(viewer, kind, topic, qos_profile=qos_profile_sensor_data)
        for topic, kind in kinds.items()
    ]
    exact = message_filters.TimeSynchronizer(heard, 10)
    exact.registerCallback(lambda image, info: found["exact"].append(image.header.frame_id))
    near = message_filters.ApproximateTimeSynchronizer(heard, queue_size=10, slop=0.1)
    near.registerCallback(lambda image, info, name: found["near"].append((image.header.frame_id, name)), "left")
    publishers = [camera.create_publisher(kind, topic, qos_profile_sensor_data) for topic, kind in kinds.items()]
    spin_until(executor, lambda: all(publisher.get_subscription_count() == 1 for publisher in publishers))
    for frame, late_ns in (("a", 0), ("b", 50_000_000), ("c", 0)):
        for kind, publisher, after in zip(kinds.values(), publishers, (0, late_ns), strict=True):
            message = kind()
            message.header.frame_id = frame
            message.header.stamp.sec = ord(frame)
            message.header.stamp.nanosec = after
            publisher.publish(message)
    spin_until(executor, lambda: len(found["near"]) == 3 and len(found["exact"]) == 2)
    assert found == {"exact": ["a", "c"], "near": [("a", "left"), ("b", "left"), ("c", "left")]}


def test_topics_that_come_are_found_by_looking_at_the_graph(pair: Any) -> None:
    from rclpy.qos import QoSProfile, QoSReliabilityPolicy
    from std_msgs.msg import Header

    executor, source, monitor = pair
    pattern = re.compile(r"/(?P<name>\w+)_data_?(?P<reliability>\w*)")
    heard: dict[str, list[str]] = {}
    for name, reliability in (("critical_data", "RELIABLE"), ("sensor_data_best_effort", "BEST_EFFORT")):
        profile = QoSProfile(depth=10, reliability=QoSReliabilityPolicy[reliability])
        publisher = source.create_publisher(Header, name, profile)
        source.create_timer(0.001, lambda publisher=publisher: publisher.publish(Header(frame_id="7_x")))

    def look() -> bool:
        for topic, types in monitor.get_topic_names_and_types():
            found = pattern.fullmatch(topic)
            if found is None or topic in heard or types != ["std_msgs/msg/Header"]:
                continue
            heard[topic] = []
            profile = QoSProfile(depth=10)
            if found["reliability"] == "best_effort":
                profile.reliability = QoSReliabilityPolicy.BEST_EFFORT
            monitor.create_subscription(Header, topic, lambda m, topic=topic: heard[topic].append(m.frame_id), profile)
        return len(heard) == 2 and all(heard.values())

    spin_until(executor, look)
    assert {topic: frames[0] for topic, frames in heard.items()} == {
        "/critical_data": "7_x",
        "/sensor_data_best_effort": "7_x",
    }
