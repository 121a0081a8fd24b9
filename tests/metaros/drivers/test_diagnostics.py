"""Diagnostics as a viewer gets them, faults as a viewer asks for them, and what a viewer may not set."""

from __future__ import annotations

import metaros
from metaros.interfaces.diagnostic_msgs.msg import DiagnosticStatus
from metaros.interfaces.metaros_msgs.msg import HostMemory
from metaros.interfaces.std_msgs.msg import String
from metaros.wire import qos_default
from tests.support.devices.drivers import running
from tests.support.waiting import wait_until


def test_a_simulated_fault_is_seen_and_ends(context: metaros.Context) -> None:
    with running("host_metrics", {"rate_hz": 10.0, "allow_faults": True}, context=context) as driver:
        fault = driver.viewer.create_publisher(String, "/r1/host_metrics/fault", 10)
        wait_until(lambda: driver.state() == "working")
        assert driver.status().level == DiagnosticStatus.OK
        assert "/r1/host_metrics/fault" in driver.node.graph.topics()
        assert driver.status().name == "/r1/host_metrics"

        def unplugged() -> bool:
            fault.publish(String(data="no such fault"))
            fault.publish(String(data="unplug"))
            return driver.state() == "waiting"

        wait_until(unplugged)
        assert driver.status().level == DiagnosticStatus.ERROR
        assert driver.status().message == "unplugged (simulated)"

        fault.publish(String(data="clear"))
        memory = driver.messages(HostMemory, "host/memory", qos_default)
        wait_until(lambda: driver.state() == "working" and bool(memory))


def test_faults_are_off_unless_the_robot_says_so(context: metaros.Context) -> None:
    with running("host_metrics", {"rate_hz": 10.0}, context=context) as driver:
        wait_until(lambda: driver.state() == "working")
        topics = driver.node.graph.topics()
        assert "/r1/diagnostics" in topics
        assert "/r1/host_metrics/fault" not in topics


def test_a_local_parameter_is_refused_on_the_wire_and_a_live_one_is_taken(context: metaros.Context) -> None:
    with (
        running("host_metrics", {"rate_hz": 10.0}, context=context) as driver,
        metaros.Context(connect=context.session.connect) as other,
        metaros.Node("setter", context=other) as setter,
    ):
        from metaros.interfaces.rcl_interfaces.msg import Parameter, ParameterType, ParameterValue
        from metaros.interfaces.rcl_interfaces.srv import SetParameters

        client = setter.create_client(SetParameters, "/r1/host_metrics/set_parameters")
        assert client.wait_for_service(60)
        text = ParameterValue(type=ParameterType.PARAMETER_STRING, string_value="/etc")
        number = ParameterValue(type=ParameterType.PARAMETER_DOUBLE, double_value=5.0)
        request = SetParameters.Request(
            parameters=[Parameter(name="disk_path", value=text), Parameter(name="rate_hz", value=number)]
        )
        results = client.call(request, timeout_s=60).results
        assert [result.successful for result in results] == [False, True]
        assert driver.node.parameters["disk_path"] == "/"
        assert driver.node.parameters["rate_hz"] == 5.0
