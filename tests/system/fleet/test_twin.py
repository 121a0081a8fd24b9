"""A twin between the real programs: tried, confirmed, taken back where the link dies of it, and over kill -9."""

from __future__ import annotations

import json
import signal
import urllib.request
from collections.abc import Iterator
from typing import Any

import pytest

from tests.support.processes.stack import Program, Stack
from tests.support.servers.cutting_proxy import CuttingProxy
from tests.support.waiting import wait_until

NAMESPACE = "/sim_1"
TRIES = 5  # to catch a trial before it is confirmed


class Robot:
    """The agent of a simulated robot, behind a link that can be cut, and its twin at the gateway."""

    def __init__(self, stack: Stack, proxy: CuttingProxy, *options: str, name: str) -> None:
        self.stack, self.proxy, self.options, self.name = stack, proxy, options, name
        self.agent = self.start()
        wait_until(lambda: name in stack.online(), timeout_s=120)
        wait_until(lambda: self.said.get("state") == "applied", timeout_s=120)

    def start(self) -> Program:
        where = ("--gateway", f"127.0.0.1:{self.proxy.port}")
        where += ("--zenoh-port", str(self.stack.zenoh_port), "--state-dir", str(self.stack.folder / "agent"))
        names = ("--name", self.name, "--namespace", NAMESPACE, "--no-host-metrics")
        return self.stack.start("agent", "agent", *names, *where, *self.options)

    def ask(self, method: str, path: str, body: object = None) -> Any:
        request = urllib.request.Request(
            f"{self.stack.url}/api/v1/robots/{self.name}/twin{path}",
            method=method,
            data=None if body is None else json.dumps(body).encode(),
            headers={"Authorization": f"Bearer {self.stack.key}", "Content-Type": "application/json"},
        )
        with urllib.request.urlopen(request, timeout=60) as answer:
            return json.load(answer)

    @property
    def twin(self) -> dict[str, Any]:
        return dict(self.ask("GET", ""))

    @property
    def said(self) -> dict[str, Any]:
        return self.twin["reported"] or {}

    def desire(self, bytes_per_s: int, *, window_s: int = 30) -> int:
        body = {"budget": {"bytes_per_s": bytes_per_s}}
        return int(self.ask("PATCH", f"?confirm_within_s={window_s}", body)["revision"])

    def budget(self) -> int | None:
        found = self.said.get("values", {}).get("budget", {}).get("bytes_per_s")
        return None if found is None else int(found)

    def kept(self) -> dict[str, Any]:
        try:
            return dict(json.loads((self.stack.folder / "agent" / "twin" / "twin.json").read_text()))
        except (FileNotFoundError, ValueError):
            return {}

    def on_trial(self, window_s: int = 5) -> int:
        """A revision that is on the robot's disk and not confirmed yet."""
        for attempt in range(TRIES):
            revision = self.desire(600_000 + attempt, window_s=window_s)
            wait_until(lambda revision=revision: self.kept().get("seen") == revision)
            if self.kept()["pending"] is not None:
                return revision
        raise AssertionError("every trial was confirmed before anybody could look")


@pytest.fixture(scope="module")
def robot(shared_gateway: Stack, tmp_path_factory: pytest.TempPathFactory) -> Iterator[Robot]:
    with shared_gateway.beside(tmp_path_factory.mktemp("robot")) as stack, CuttingProxy(stack.grpc_port) as proxy:
        stack.router()
        yield Robot(stack, proxy, name="twin")


@pytest.mark.integration
def test_a_twin_is_confirmed_and_one_that_the_link_dies_of_is_taken_back(robot: Robot) -> None:
    kept = robot.desire(500_000)
    wait_until(lambda: robot.twin["in_step"], timeout_s=120)
    assert (robot.kept()["applied"]["revision"], robot.budget()) == (kept, 500_000)
    tried = robot.on_trial()
    robot.proxy.cut_after(up=0, down=0)
    confirmed = robot.kept()["applied"]["revision"]  # the last before the trial, or the trial itself: we were late
    wait_until(lambda: robot.kept()["pending"] is None, timeout_s=120)
    robot.proxy.mend()
    if robot.kept()["applied"]["revision"] != tried:
        assert robot.kept()["applied"]["revision"] == confirmed
        wait_until(lambda: robot.said.get("state") == "reverted", timeout_s=120)
        found = robot.twin
        assert (found["revision"], found["in_step"], found["reported"]["applied"]) == (tried, False, confirmed)
        assert found["reported"]["code"] == "not_confirmed"
    again = robot.desire(700_000)
    wait_until(lambda: robot.twin["in_step"], timeout_s=120)
    assert (robot.kept()["applied"]["revision"], robot.budget()) == (again, 700_000)


@pytest.mark.integration
def test_an_agent_that_is_killed_on_trial_ends_with_one_of_the_two(robot: Robot) -> None:
    robot.desire(500_000)
    wait_until(lambda: robot.twin["in_step"], timeout_s=120)
    tried = robot.on_trial(window_s=6)
    robot.agent.process.send_signal(signal.SIGKILL)
    robot.agent.process.wait(60)
    before = robot.kept()
    robot.agent = robot.start()
    wait_until(lambda: robot.kept()["pending"] is None, timeout_s=120)
    after = robot.kept()
    assert after["applied"]["revision"] in (before["applied"]["revision"], tried)
    wait_until(lambda: robot.said.get("applied") == after["applied"]["revision"], timeout_s=120)
    assert robot.budget() == json.loads(after["applied"]["document"])["budget"]["bytes_per_s"]


@pytest.mark.integration
def test_a_topic_changes_its_class_while_it_flows(robot: Robot) -> None:
    """Samples of each class come to the gateway under the topic's one name; then the robot's own table holds again."""
    robot.stack.sim("--seed", "1")

    def odometry() -> dict[str, Any]:
        return robot.stack.topics(robot.name).get("/sim_1/odom", {})

    wait_until(lambda: odometry().get("class") == "live", timeout_s=120)
    for delivery in ("bulk", "event"):
        received = odometry()["received"]
        robot.ask("PATCH", "", {"topics": {"odom": {"class": delivery, "rate_hz": 3.0}}})
        wait_until(lambda: robot.twin["in_step"], timeout_s=120)
        wait_until(lambda delivery=delivery: odometry()["class"] == delivery)
        wait_until(lambda received=received: odometry()["received"] > received + 5, timeout_s=120)
    robot.ask("PATCH", "", {"topics": None})
    wait_until(lambda: robot.twin["in_step"], timeout_s=120)
    wait_until(lambda: (odometry()["class"], odometry()["history_hz"]) == ("live", 2.0))
    assert odometry()["lost"] == 0
