"""`metaros driver`: what there is, what is plugged in, and a driver of one's own, run."""

from __future__ import annotations

import json
import signal
import subprocess
import sys
from pathlib import Path

import metaros
from metaros.interfaces.metaros_msgs.msg import HostMemory
from metaros.interfaces.std_msgs.msg import Float64
from tests.support.pty_device import PtyDevice
from tests.support.waiting import wait_until


def driver(*arguments: str) -> subprocess.CompletedProcess[str]:
    command = [sys.executable, "-m", "metaros", "driver", *arguments]
    return subprocess.run(command, capture_output=True, text=True, check=False, timeout=120)


def test_the_list_says_what_is_missing_here() -> None:
    rows = json.loads(driver("list", "-o", "json").stdout)
    ld19 = next(row for row in rows if row["kind"] == "ld19")
    assert (ld19["quality"], ld19["missing"]) == ("silver", [])
    assert "ld19" in driver("list").stdout


def test_info_shows_topics_and_parameters() -> None:
    text = driver("info", "ld19").stdout
    for word in ("LaserScan", "range_max_m", "12.0", "byte-true emulator"):
        assert word in text
    assert json.loads(driver("info", "ld19", "-o", "json").stdout)["kind"] == "ld19"


def test_probe_tells_commands_and_refuses_unknown_kinds() -> None:
    for found in json.loads(driver("probe", "-o", "json").stdout):
        assert found["command"].startswith(f"metaros driver run {found['kind']}")
    done = driver("probe", "toaster")
    assert (done.returncode, "no driver 'toaster'" in done.stderr) == (2, True)


def test_what_is_wrong_is_said_before_anything_is_asked() -> None:
    for arguments, said in (
        (("toaster",), "no driver 'toaster'; there are"),
        (("ld19", "-p", "port"), "is not NAME=VALUE"),
        (("ld19", "-p", "prot=x"), "did you mean 'port'"),
        (("ld19", "-p", "bins=1"), "must be 36 to 3600"),
        (("./nowhere",), "manifest.toml"),
    ):
        done = driver("run", *arguments, "--zenoh-port", "1")
        assert done.returncode == 2, done.stderr
        assert said in done.stderr


def test_a_driver_runs_under_its_name_until_ctrl_c(zenoh_router: str) -> None:
    port = zenoh_router.rsplit(":", 1)[1]
    options = ["-p", "rate_hz=10", "--namespace", "/r1", "--name", "computer", "--zenoh-port", port]
    command = [sys.executable, "-m", "metaros", "driver", "run", "host_metrics", *options]
    process = subprocess.Popen(command)
    try:
        with metaros.Context(connect=zenoh_router) as context, metaros.Node("viewer", context=context) as viewer:
            memory: list[HostMemory] = []
            viewer.create_subscription(HostMemory, "/r1/host/memory", memory.append, 10)
            executor = metaros.SingleThreadedExecutor()
            executor.add_node(viewer)
            wait_until(lambda: executor.spin_once(0.05) or len(memory) > 2)
            executor.shutdown()
        process.send_signal(signal.SIGINT)
        assert process.wait(60) == 0
    finally:
        process.kill()
        process.wait()


def test_a_new_driver_runs_from_its_folder(zenoh_router: str, tmp_path: Path) -> None:
    made = driver("new", "sonar_toy", "--directory", str(tmp_path))
    assert made.returncode == 0
    assert "metaros driver run" in made.stdout
    port = zenoh_router.rsplit(":", 1)[1]
    with PtyDevice(tmp_path) as device:
        options = ["-p", f"port={device.path}", "--zenoh-port", port]
        command = [sys.executable, "-m", "metaros", "driver", "run", str(tmp_path / "sonar_toy"), *options]
        process = subprocess.Popen(command)
        try:
            with metaros.Context(connect=zenoh_router) as context, metaros.Node("viewer", context=context) as viewer:
                values: list[Float64] = []
                viewer.create_subscription(Float64, "/sonar_toy/value", values.append, metaros.qos_sensor_data)
                executor = metaros.SingleThreadedExecutor()
                executor.add_node(viewer)

                def heard() -> bool:
                    device.write(b"4.5\n")
                    executor.spin_once(0.05)
                    return bool(values)

                wait_until(heard)
                executor.shutdown()
            assert values[0].data == 4.5
        finally:
            process.send_signal(signal.SIGINT)
            process.wait(60)
