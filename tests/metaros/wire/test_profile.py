"""The protected profile on a real router: who may open a session, who may drive, and what stays as it was."""

from __future__ import annotations

import json
import os
import stat
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest
import zenoh

import metaros
from metaros.errors import ConfigError
from metaros.interfaces.geometry_msgs.msg import Twist
from metaros.interfaces.std_msgs.msg import String
from metaros.wire.profile import USERS, actuator_keys, make_profile, other_keys, session_file
from metaros.wire.router import Router, open_router
from tests.support.ports import free_port
from tests.support.waiting import wait_until


@pytest.fixture
def protected(tmp_path: Path) -> Iterator[tuple[Router, Path]]:
    """A protected router, and the folder of its profile."""
    folder = tmp_path / "zenoh"
    with open_router(free_port(), protected=folder) as router:
        yield router, folder


def session_of(folder: Path, user: str, override: str = "") -> metaros.Context:
    """A session of one of the users, opened as a program's environment would."""
    uri = str(folder / f"{user}.json5")
    return metaros.Context(environ={"ZENOH_SESSION_CONFIG_URI": uri, "ZENOH_CONFIG_OVERRIDE": override})


def take(node: metaros.Node) -> None:
    """Let its callbacks run."""
    executor = metaros.SingleThreadedExecutor()
    executor.add_node(node)
    try:
        executor.spin_once(timeout_s=0.05)
    finally:
        executor.remove_node(node)


class Ears:
    """A base that listens to its drive commands, and to the chatter."""

    def __init__(self, context: metaros.Context) -> None:
        self.node = metaros.Node("base", namespace="/sim_1", context=context)
        self.driven: list[float] = []
        self.heard: list[str] = []
        self.node.create_subscription(Twist, "cmd_vel", lambda twist: self.driven.append(twist.linear.x), 10)
        self.node.create_subscription(String, "chatter", lambda text: self.heard.append(text.data), 10)

    def listen(self) -> None:
        """Take in what came."""
        take(self.node)


def speak(context: metaros.Context, value: float, name: str) -> None:
    """Publish a drive command, then chatter, on one session: whoever has the second could have had the first."""
    with metaros.Node(name, namespace="/sim_1", context=context) as node:
        drive, chatter = node.create_publisher(Twist, "cmd_vel", 10), node.create_publisher(String, "chatter", 10)
        wait_until(lambda: all(context.graph.endpoints(f"/sim_1/{end}", "MS") for end in ("cmd_vel", "chatter")))
        twist = Twist()
        twist.linear.x = value
        drive.publish(twist)
        chatter.publish(String(data=name))


def test_only_agent_and_drive_move_the_robot(protected: tuple[Router, Path]) -> None:
    _, folder = protected
    with session_of(folder, "node") as base:
        ears = Ears(base)
        for value, user in enumerate(("agent", "node", "drive"), 1):
            with session_of(folder, user) as context:
                speak(context, value, user)

                def received(user: str = user) -> bool:
                    ears.listen()
                    return user in ears.heard

                wait_until(received)
        assert ears.heard == ["agent", "node", "drive"]
        assert ears.driven == [1.0, 3.0]


TWIST = "geometry_msgs::msg::dds_::Twist_/RIHS01_" + "a" * 64
# Zenoh carries a put on a key with wildcards to every subscriber that it touches.
AROUND = (
    *(f"0/sim_1/cmd_vel/{TWIST}", "**", "0/**", "*/**", f"0/*/cmd_vel/{TWIST}", f"0/sim_1/*/{TWIST}"),
    *(f"0/sim_1/c$*/{TWIST}", f"0/sim_1/cmd_vel$*/{TWIST}", f"0/sim_1/$*d_vel/{TWIST}", "0/sim_1/**/RIHS01_$*"),
    *("0/sim_1/cmd_vel/**", "0/sim_1/*/*/*", f"0/**/{TWIST}", "*/**/c$*/*/RIHS01_$*"),
)


@pytest.mark.parametrize("mode", ["client", "peer", "router"])
def test_no_wildcard_leads_around_the_access_control(protected: tuple[Router, Path], mode: str) -> None:
    _, folder = protected
    received: list[str] = []
    config = zenoh.Config.from_file(str(folder / "node.json5"))
    base = zenoh.open(config)
    config.insert_json5("mode", json.dumps(mode))
    stranger = zenoh.open(config)
    try:
        base.declare_subscriber(f"0/sim_1/cmd_vel/{TWIST}", lambda sample: received.append(str(sample.key_expr)))
        base.declare_subscriber("0/sim_1/odom/t/RIHS01_b", lambda sample: received.append("odom"))
        for key in AROUND:
            stranger.put(key, b"drive")
            stranger.declare_publisher(key).put(b"drive")
            stranger.delete(key)

        def reported() -> bool:
            stranger.put("0/sim_1/odom/t/RIHS01_b", b"")
            return "odom" in received

        wait_until(reported)
        assert set(received) == {"odom"}
    finally:
        stranger.close()  # type: ignore[no-untyped-call]
        base.close()  # type: ignore[no-untyped-call]


def test_what_a_node_may_publish_touches_no_actuator() -> None:
    allowed = [zenoh.KeyExpr(key) for key in other_keys(["**/cmd_vel", "/arm/grip"])]
    for place in ("*", "*/*", "*/*/*"):
        for name in ("cmd_vel", "grip"):
            actuator = zenoh.KeyExpr(f"{place}/{name}/$*::$*/RIHS01_$*")
            assert not any(one.intersects(actuator) for one in allowed)
    for name in ("cmd", "cmd_ve", "cmd_vela", "cmd_vel_x", "Cmd_vel", "g", "grip2", "odom", "_x", "9"):
        for topic in (f"0/{name}", f"232/a/cmd_vel/{name}"):
            assert sum(one.includes(f"{topic}/p::msg::dds_::T_/RIHS01_ab") for one in allowed) == 1


def test_an_actuator_whose_name_is_not_reported_is_refused() -> None:
    for pattern in ("**", "/arm/*", "**/cmd_*", "/"):
        with pytest.raises(ConfigError, match="last name"):
            other_keys([pattern])


def test_who_has_no_password_has_no_session(protected: tuple[Router, Path]) -> None:
    router, folder = protected
    for credentials in ("", ';transport/auth/usrpwd={user:"agent",password:"wrong"}'):
        override = f'mode="client";connect/exit_on_failure=true;connect/timeout_ms=200{credentials}'
        with pytest.raises(ConfigError, match="no Zenoh session"):
            metaros.Context(connect=router.endpoint, environ={"ZENOH_CONFIG_OVERRIDE": override})
    password = dict(line.split(":") for line in (folder / "users").read_text().splitlines())["agent"]
    override = f'mode="client";connect/timeout_ms=60000;transport/auth/usrpwd={{user:"agent",password:"{password}"}}'
    with metaros.Context(connect=router.endpoint, environ={"ZENOH_CONFIG_OVERRIDE": override}) as context:
        wait_until(context.connected)


def test_services_parameters_and_late_samples_work_for_all(protected: tuple[Router, Path]) -> None:
    _, folder = protected
    latched = metaros.QoSProfile(depth=1, durability=metaros.Durability.TRANSIENT_LOCAL)
    with session_of(folder, "node") as one, session_of(folder, "node") as two:
        talker = metaros.Node("talker", context=one)
        talker.create_publisher(String, "map", latched).publish(String(data="early"))
        talker.declare_parameter("speed", 3)
        listener = metaros.Node("listener", context=two)
        received: list[str] = []
        listener.create_subscription(String, "map", lambda text: received.append(text.data), latched)

        def arrived() -> bool:
            take(listener)
            return bool(received)

        wait_until(arrived)
        wait_until(lambda: {"/talker", "/listener"} <= {node.full_name for node in two.graph.nodes()})


def test_a_session_comes_back_after_the_router(protected: tuple[Router, Path]) -> None:
    router, folder = protected
    retry = "connect/retry={period_init_ms:50,period_max_ms:100,period_increase_factor:2}"
    with session_of(folder, "agent", retry) as context:
        wait_until(context.connected)
        router.close()
        wait_until(lambda: not context.connected())
        with open_router(router.port, protected=folder):
            wait_until(context.connected)


def test_passwords_stay_over_restarts_and_are_nobody_elses(tmp_path: Path) -> None:
    folder = tmp_path / "zenoh"
    make_profile(folder, "tcp/127.0.0.1:1")
    first = (folder / "users").read_text()
    make_profile(folder, "tcp/127.0.0.1:2")
    assert (folder / "users").read_text() == first
    assert "127.0.0.1:2" in session_file(folder, "node").read_text()
    passwords = [line.partition(":")[2] for line in first.splitlines()]
    assert len(set(passwords)) == len(USERS)
    if sys.platform != "win32":
        assert {stat.S_IMODE(path.stat().st_mode) for path in folder.iterdir()} == {0o600}
        folder.chmod(0o755)
        with pytest.raises(ConfigError, match="chmod 700"):
            make_profile(folder, "tcp/127.0.0.1:3")


def test_a_missing_session_file_says_who_makes_it(tmp_path: Path) -> None:
    with pytest.raises(ConfigError, match="metaros router --zenoh-profile protected"):
        session_file(tmp_path, "agent")


def test_actuator_patterns_become_key_expressions() -> None:
    assert actuator_keys(["**/cmd_vel"])[0] == "*/**/cmd_vel/*/*"
    assert actuator_keys(["/arm_*/*/joint"])[0] == "*/arm_$*/*/joint/*/*"
    for pattern in ("**/cmd_vel", "/arm_*/*/joint", "**"):
        for key in actuator_keys([pattern]):
            assert str(zenoh.KeyExpr.autocanonize(key))
    moving = zenoh.KeyExpr(actuator_keys(["**/cmd_vel"])[0])
    for topic, moves in (("0/cmd_vel/t/h", True), ("7/a/b/cmd_vel/t/h", True), ("0/cmd_vel/x/t/h", False)):
        assert moving.includes(topic) is moves


def test_environment_is_left_alone(protected: tuple[Router, Path]) -> None:
    _, folder = protected
    with session_of(folder, "agent"):
        assert "ZENOH_SESSION_CONFIG_URI" not in os.environ
