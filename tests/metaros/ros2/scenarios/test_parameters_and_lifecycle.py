"""What the demos' programs of parameters, loggers, introspection and lifecycles do, typed anew."""

from __future__ import annotations

import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import pytest

pytestmark = pytest.mark.usefixtures("rclpy_program")


@contextmanager
def spun(*nodes: Any) -> Iterator[Any]:
    """A thread spins these nodes."""
    from rclpy.executors import SingleThreadedExecutor

    executor = SingleThreadedExecutor()
    for node in nodes:
        executor.add_node(node)
    thread = threading.Thread(target=executor.spin)
    thread.start()
    try:
        yield executor
    finally:
        executor.shutdown()
        thread.join()


def ask(node: Any, service: Any, name: str, request: Any) -> Any:
    """The answer to one call."""
    import rclpy

    client = node.create_client(service, name)
    assert client.wait_for_service(timeout_sec=30)
    future = client.call_async(request)
    rclpy.spin_until_future_complete(node, future, timeout_sec=30)
    return future.result()


def test_callbacks_before_at_and_after_a_change() -> None:
    import rclpy
    from rcl_interfaces.msg import SetParametersResult
    from rcl_interfaces.srv import SetParameters
    from rclpy.node import Node
    from rclpy.parameter import Parameter

    class Demo(Node):  # type: ignore[misc]
        def __init__(self) -> None:
            super().__init__("set_parameters_callback")
            self.tracked = {name: self.declare_parameter(name, 0.0).value for name in ("param1", "param2")}
            self.add_pre_set_parameters_callback(self.before)
            self.add_on_set_parameters_callback(self.check)
            self.add_post_set_parameters_callback(self.after)

        def before(self, parameters: list[Any]) -> list[Any]:
            more = [Parameter("param2", Parameter.Type.DOUBLE, 4.0) for found in parameters if found.name == "param1"]
            return [*parameters, *more]

        def check(self, parameters: list[Any]) -> Any:
            return SetParametersResult(successful=all(found.value < 9 for found in parameters), reason="too much")

        def after(self, parameters: list[Any]) -> None:
            self.tracked.update({found.name: found.value for found in parameters})

    with rclpy.init():
        demo, caller = Demo(), rclpy.create_node("caller")
        with spun(demo):
            name = "/set_parameters_callback/set_parameters"
            for value, expected in ((1.5, (True, "")), (10.0, (False, "too much"))):
                request = SetParameters.Request(parameters=[Parameter("param1", value=value).to_parameter_msg()])
                (result,) = ask(caller, SetParameters, name, request).results
                assert (result.successful, result.reason) == expected
        assert demo.tracked == {"param1": 1.5, "param2": 4.0}
        assert demo.get_parameter("param2").value == 4.0


def test_a_client_of_parameters_and_a_file(tmp_path: Path) -> None:
    import rclpy
    from rclpy.parameter import Parameter, parameter_dict_from_yaml_file, parameter_value_to_python
    from rclpy.parameter_client import AsyncParameterClient

    file = tmp_path / "params.yaml"
    file.write_text("/blackboard:\n  ros__parameters:\n    int_parameter: 12\n    other: {text: One fish, is: true}\n")
    with rclpy.init():
        node = rclpy.create_node("async_param_client")
        board = rclpy.create_node("blackboard", allow_undeclared_parameters=True)
        client = AsyncParameterClient(node, "blackboard")
        with spun(board):
            assert client.wait_for_services(30.0)

            def done(future: Any) -> Any:
                rclpy.spin_until_future_complete(node, future, timeout_sec=30)
                return future.result()

            names = ["int_parameter", "string_parameter"]
            made = [Parameter(names[0], Parameter.Type.INTEGER, 10), Parameter(names[1], value="Fee")]
            assert [result.successful for result in done(client.set_parameters(made)).results] == [True, True]
            assert set(done(client.list_parameters(names, 10)).result.names) == set(names)
            values = done(client.get_parameters(names)).values
            assert [parameter_value_to_python(value) for value in values] == [10, "Fee"]
            loaded = done(client.load_parameter_file(str(file)))
            read = parameter_dict_from_yaml_file(str(file), False, target_nodes=["blackboard"])
            assert list(read) == ["int_parameter", "other.text", "other.is"]
            assert all(result.successful for result in loaded.results)
            gone = done(client.delete_parameters(["string_parameter", "nobody"])).results
            assert gone[0].successful
        found = {name: board.get_parameter(name).value for name in read}
        assert found == {"int_parameter": 12, "other.text": "One fish", "other.is": True}
        assert not board.has_parameter("string_parameter")


def test_levels_of_a_logger_and_its_child_by_service(capfd: pytest.CaptureFixture[str]) -> None:
    import rclpy
    from rcl_interfaces.msg import LoggerLevel
    from rcl_interfaces.srv import GetLoggerLevels, SetLoggerLevels
    from rclpy.impl.logging_severity import LoggingSeverity

    with rclpy.init():
        talker = rclpy.create_node("LoggerServiceNode", enable_logger_service=True)
        child = talker.get_logger().get_child("child")
        caller = rclpy.create_node("TestNode")

        def talk() -> list[str]:
            for logger in (talker.get_logger(), child):
                logger.debug("said")
                logger.info("said")
                logger.warning("said")
                logger.error("said")
            lines = capfd.readouterr().err.splitlines()
            return [
                f"{line.split('] ')[0][1:]} {line.split('[')[-1].split(']')[0]}" for line in lines if "said" in line
            ]

        with spun(talker):
            both = [
                f"{level} LoggerServiceNode{part}" for part in ("", ".child") for level in ("INFO", "WARN", "ERROR")
            ]
            assert talk() == both
            levels = [
                LoggerLevel(name="LoggerServiceNode", level=LoggingSeverity.WARN),
                LoggerLevel(name="LoggerServiceNode.child", level=LoggingSeverity.DEBUG),
            ]
            request = SetLoggerLevels.Request(levels=levels)
            answer = ask(caller, SetLoggerLevels, "LoggerServiceNode/set_logger_levels", request)
            assert [result.successful for result in answer.results] == [True, True]
            names = [level.name for level in levels]
            answer = ask(
                caller, GetLoggerLevels, "/LoggerServiceNode/get_logger_levels", GetLoggerLevels.Request(names=names)
            )
            assert [level.level for level in answer.levels] == [30, 10]
            assert talk() == [
                "WARN LoggerServiceNode",
                "ERROR LoggerServiceNode",
                *[f"{level} LoggerServiceNode.child" for level in ("DEBUG", "INFO", "WARN", "ERROR")],
            ]
        for name in names:
            rclpy.logging.set_logger_level(name, LoggingSeverity.UNSET)


def test_introspection_that_a_parameter_switches() -> None:
    import rclpy
    from example_interfaces.srv import AddTwoInts
    from rclpy.node import Node
    from rclpy.parameter import Parameter
    from rclpy.qos import qos_profile_system_default
    from rclpy.service_introspection import ServiceIntrospectionState
    from service_msgs.msg import ServiceEventInfo

    states = {"disabled": "OFF", "metadata": "METADATA", "contents": "CONTENTS"}

    class Server(Node):  # type: ignore[misc]
        def __init__(self) -> None:
            super().__init__("introspection_service")
            self.srv = self.create_service(AddTwoInts, "add_two_ints", self.add)
            self.add_post_set_parameters_callback(self.changed)
            self.declare_parameter("introspection", "disabled")

        def add(self, request: Any, response: Any) -> Any:
            response.sum = request.a + request.b
            return response

        def changed(self, parameters: list[Any]) -> None:
            for found in parameters:
                state = ServiceIntrospectionState[states[found.value]]
                self.srv.configure_introspection(self.get_clock(), qos_profile_system_default, state)

    with rclpy.init():
        server, node = Server(), rclpy.create_node("watcher")
        heard: list[Any] = []
        event = AddTwoInts.Event
        node.create_subscription(event, "add_two_ints/_service_event", heard.append, 10)
        with spun(server):
            for state, count in (("metadata", 2), ("contents", 4), ("disabled", 4)):
                assert server.set_parameters([Parameter("introspection", value=state)])[0].successful
                assert ask(node, AddTwoInts, "add_two_ints", AddTwoInts.Request(a=2, b=3)).sum == 5
                while len(heard) < count:  # the answer is told of after it is sent
                    rclpy.spin_once(node, timeout_sec=1.0)
    kinds = [ServiceEventInfo.REQUEST_RECEIVED, ServiceEventInfo.RESPONSE_SENT]
    assert [message.info.event_type for message in heard] == kinds * 2
    told = [([found.a for found in message.request], [found.sum for found in message.response]) for message in heard]
    assert told == [([], []), ([], []), ([2], []), ([], [5])]


def test_a_lifecycle_talker_and_who_manages_it() -> None:
    import rclpy
    from lifecycle_msgs.msg import Transition
    from lifecycle_msgs.srv import ChangeState, GetState
    from rclpy.lifecycle import Node, Publisher, State, TransitionCallbackReturn
    from std_msgs.msg import String

    class Talker(Node):  # type: ignore[misc]
        def __init__(self, node_name: str, **kwargs: Any) -> None:
            self._pub: Any = None
            self._timer: Any = None
            self.calls: list[str] = []
            super().__init__(node_name, **kwargs)

        def publish(self) -> None:
            self._pub.publish(String(data="active" if self._pub.is_activated else "inactive"))

        def on_configure(self, state: State) -> Any:
            self._pub = self.create_lifecycle_publisher(String, "lifecycle_chatter", 10)
            assert isinstance(self._pub, Publisher)
            self._timer = self.create_timer(0.001, self.publish)
            self.calls.append(f"configure from {state.label}")
            return TransitionCallbackReturn.SUCCESS

        def on_activate(self, state: State) -> Any:
            self.calls.append(f"activate from {state.label}")
            return super().on_activate(state)

        def on_cleanup(self, state: State) -> Any:
            self.destroy_timer(self._timer)
            self.destroy_publisher(self._pub)
            self.calls.append("cleanup")
            return TransitionCallbackReturn.SUCCESS

    rclpy.init()
    talker, manager = Talker("lc_talker"), rclpy.create_node("lifecycle_manager")
    heard: list[str] = []
    manager.create_subscription(String, "lifecycle_chatter", lambda message: heard.append(message.data), 10)
    with spun(talker):

        def change(number: int) -> str:
            request = ChangeState.Request()
            request.transition.id = number
            assert ask(manager, ChangeState, "lc_talker/change_state", request).success
            return str(ask(manager, GetState, "lc_talker/get_state", GetState.Request()).current_state.label)

        assert change(Transition.TRANSITION_CONFIGURE) == "inactive"
        rclpy.spin_once(manager, timeout_sec=0.02)
        assert heard == []
        assert change(Transition.TRANSITION_ACTIVATE) == "active"
        while not heard:
            rclpy.spin_once(manager, timeout_sec=1.0)
        assert change(Transition.TRANSITION_DEACTIVATE) == "inactive"
        assert change(Transition.TRANSITION_CLEANUP) == "unconfigured"
        assert change(Transition.TRANSITION_UNCONFIGURED_SHUTDOWN) == "finalized"
    assert set(heard) == {"active"}
    assert talker.calls == ["configure from unconfigured", "activate from inactive", "cleanup"]


def test_parameters_of_the_command_line_and_a_namespace(monkeypatch: pytest.MonkeyPatch) -> None:
    import rclpy
    from rclpy.exceptions import ParameterAlreadyDeclaredException, ParameterNotDeclaredException

    words = ["program", "--rate", "5", "--ros-args", "-p", "speed:=2.5", "-p", "names:=[a, b]", "-r", "__ns:=/robot1"]
    monkeypatch.setattr("sys.argv", words)
    assert rclpy.utilities.remove_ros_args(words) == ["program", "--rate", "5"]
    with rclpy.init():
        node = rclpy.create_node("mover")
        node.declare_parameters("", [("speed", 1.0), ("names", ["x"]), ("wheel.radius", 0.1), ("wheel.count", 4)])
        assert node.get_fully_qualified_name() == "/robot1/mover"
        assert node.get_parameter("speed").get_parameter_value().double_value == 2.5
        assert [found.value for found in node.get_parameters(["names", "wheel.count"])] == [["a", "b"], 4]
        assert set(node.get_parameters_by_prefix("wheel")) == {"radius", "count"}
        refused: dict[type[Exception], Callable[[], Any]] = {
            ParameterNotDeclaredException: lambda: node.get_parameter("nobody"),
            ParameterAlreadyDeclaredException: lambda: node.declare_parameter("speed", 1.0),
        }
        for error, call in refused.items():
            with pytest.raises(error):
                call()
