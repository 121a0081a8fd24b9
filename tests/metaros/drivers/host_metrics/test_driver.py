"""The host as a driver's topics."""

from __future__ import annotations

import metaros
from metaros.interfaces.metaros_msgs.msg import HostCpu, HostMemory
from metaros.wire import qos_default
from tests.support.devices.drivers import running
from tests.support.waiting import wait_until


def test_the_host_is_published_below_the_chosen_name(context: metaros.Context) -> None:
    with running("host_metrics", {"rate_hz": 10.0, "topic": "computer"}, context=context) as driver:
        cpu = driver.messages(HostCpu, "computer/cpu", qos_default)
        memory = driver.messages(HostMemory, "computer/memory", qos_default)
        wait_until(lambda: len(cpu) > 1 and len(memory) > 1 and driver.state() == "working")
    assert 0 <= cpu[-1].percent <= 100
    assert memory[-1].total_bytes > memory[-1].used_bytes > 0
    assert cpu[-1].stamp.sec > 0
