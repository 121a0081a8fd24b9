"""A stand-in for the `ros2` command where there is none: what the kit asks of it, printed as ROS 2 Jazzy prints it.

A program on rclpy as `ros2` itself is one. It checks the kit's way with a real installation, not ROS 2.
"""

from __future__ import annotations

import sys
from typing import Any

import rclpy
import yaml
from lifecycle_msgs.srv import ChangeState, GetAvailableTransitions, GetState
from rclpy.action import ActionClient
from rclpy.parameter import Parameter, get_parameter_value, parameter_value_to_python
from rclpy.parameter_client import AsyncParameterClient
from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy
from rosidl_runtime_py import message_to_yaml, set_message_fields
from rosidl_runtime_py.utilities import get_action, get_message, get_service

FLAGS = ("--full-length", "--feedback", "--no-daemon", "-v")
STATUS = {4: "SUCCEEDED", 5: "CANCELED", 6: "ABORTED"}
LABELS = {"BOOL": "Boolean value is:", "INTEGER": "Integer value is:", "DOUBLE": "Double value is:"}


class Command:
    """Its words, and its options by name."""

    def __init__(self, arguments: list[str]) -> None:
        self.words: list[str] = []
        self.options: dict[str, str] = {}
        rest = iter(arguments)
        for word in rest:
            if word in FLAGS:
                continue
            if word.startswith("-") and not word[1:].isdigit():
                self.options[word.lstrip("-")] = next(rest)
            else:
                self.words.append(word)
        self.node = rclpy.create_node("_ros2cli_stand_in", start_parameter_services=False)

    def run(self) -> None:
        """`topic pub` is `topic_pub`."""
        noun, verb, *words = self.words
        getattr(self, f"{noun}_{verb}")(*words)

    def qos(self) -> Any:
        """As the options say."""
        return QoSProfile(
            depth=int(self.options["qos-depth"]),
            reliability=ReliabilityPolicy[self.options["qos-reliability"].upper()],
            durability=DurabilityPolicy[self.options["qos-durability"].upper()],
        )

    def until(self, future: Any) -> Any:
        """Its result."""
        rclpy.spin_until_future_complete(self.node, future)
        return future.result()

    def ask(self, service_type: Any, name: str, request: Any) -> Any:
        """A service's answer."""
        client = self.node.create_client(service_type, name)
        client.wait_for_service()
        return self.until(client.call_async(request))

    def topic_pub(self, topic: str, type_name: str, values: str) -> None:
        message = get_message(type_name)()
        set_message_fields(message, yaml.safe_load(values))
        publisher = self.node.create_publisher(type(message), topic, self.qos())
        count, times = 0, int(self.options.get("times", "0"))
        print("publisher: beginning loop")

        def publish() -> None:
            nonlocal count
            count += 1
            print(f"publishing #{count}: {message!r}\n")
            publisher.publish(message)
            if count == times:
                timer.cancel()

        timer = self.node.create_timer(1 / float(self.options["r"]), publish)
        rclpy.spin(self.node)

    def topic_echo(self, topic: str, type_name: str) -> None:
        def show(message: Any) -> None:
            print(message_to_yaml(message), end="---\n")

        self.node.create_subscription(get_message(type_name), topic, show, self.qos())
        rclpy.spin(self.node)

    def topic_info(self, topic: str) -> None:
        kinds = (self.node.get_publishers_info_by_topic, self.node.get_subscriptions_info_by_topic)
        for name, found in zip(("Publisher", "Subscription"), [look(topic) for look in kinds], strict=True):
            print(f"\n{name} count: {len(found)}\n")
            for info in found:
                print(f"{info}\n")

    def service_call(self, name: str, type_name: str, values: str) -> None:
        request = get_service(type_name).Request()
        set_message_fields(request, yaml.safe_load(values))
        print(f"requester: making request: {request!r}\n")
        print(f"response:\n{self.ask(get_service(type_name), name, request)!r}\n")

    def action_send_goal(self, name: str, type_name: str, values: str) -> None:
        action = get_action(type_name)
        client = ActionClient(self.node, action, name)
        goal = action.Goal()
        set_message_fields(goal, yaml.safe_load(values))
        print("Waiting for an action server to become available...")
        client.wait_for_server()
        print(f"Sending goal:\n     {message_to_yaml(goal)}")
        handle = self.until(
            client.send_goal_async(goal, lambda told: print(f"Feedback:\n    {message_to_yaml(told.feedback)}"))
        )
        if not handle.accepted:
            print("Goal was rejected.")
            return
        print(f"Goal accepted with ID: {bytes(handle.goal_id.uuid).hex()}\n")
        end = self.until(handle.get_result_async())
        print(f"Result:\n    {message_to_yaml(end.result)}")
        print(f"Goal finished with status: {STATUS[end.status]}")

    def parameters(self, node: str) -> Any:
        """A client of its services."""
        client = AsyncParameterClient(self.node, node)
        client.wait_for_services(60.0)
        return client

    def param_list(self, node: str) -> None:
        for name in self.until(self.parameters(node).list_parameters()).result.names:
            print(f"  {name}")

    def param_get(self, node: str, name: str) -> None:
        (value,) = self.until(self.parameters(node).get_parameters([name])).values
        print(LABELS[Parameter.Type(value.type).name], parameter_value_to_python(value))

    def param_set(self, node: str, name: str, text: str) -> None:
        value = parameter_value_to_python(get_parameter_value(text))
        (result,) = self.until(self.parameters(node).set_parameters([Parameter(name, value=value)])).results
        if result.successful:
            print("Set parameter successful")
        else:
            print(f"Setting parameter failed: {result.reason}", file=sys.stderr)

    def lifecycle_get(self, node: str) -> None:
        state = self.ask(GetState, f"{node}/get_state", GetState.Request()).current_state
        print(f"{state.label} [{state.id}]")

    def lifecycle_set(self, node: str, label: str) -> None:
        offered = self.ask(
            GetAvailableTransitions, f"{node}/get_available_transitions", GetAvailableTransitions.Request()
        )
        found = [one.transition for one in offered.available_transitions if one.transition.label == label]
        if not found:
            print("Unknown transition requested, available ones are:")
            return
        request = ChangeState.Request()
        request.transition = found[0]
        done = self.ask(ChangeState, f"{node}/change_state", request).success
        print("Transitioning successful" if done else "Transitioning failed")

    def node_list(self) -> None:
        for name, namespace in self.node.get_node_names_and_namespaces():
            print(f"{namespace.rstrip('/')}/{name}")


if __name__ == "__main__":
    rclpy.init(args=sys.argv[:1])
    try:
        Command(sys.argv[1:]).run()
    except KeyboardInterrupt:
        pass
    finally:
        rclpy.try_shutdown()
