"""The launch table, pure."""

from __future__ import annotations

from pathlib import Path

from metaros.cli.up.launch_table import Plan, Replica, first_free_robot, host_robot_name, launches
from tests.support.tables import cases


def plan(**changes: object) -> Plan:
    """A plan as `metaros up` makes it, with changes."""
    values: dict[str, object] = {
        "host": "127.0.0.1",
        "http_port": 8080,
        "grpc_port": 8081,
        "zenoh_port": 7447,
        "domain": 0,
        "own_router": True,
        "data_dir": Path("/data"),
        "robots": 3,
        "first_robot": 1,
        "seed": 1,
        "host_robot": "desk",
        "camera": "",
    }
    return Plan(**{**values, **changes})  # type: ignore[arg-type]


def test_three_robots_and_this_machine() -> None:
    rows = launches(plan())
    names = ["router", "gateway", "sim", "agent sim_1", "agent sim_2", "agent sim_3", "agent desk"]
    assert [row.name for row in rows] == names
    assert [row.stage for row in rows] == [0, 1, 2, 3, 3, 3, 3]
    assert plan().robot_names == ("sim_1", "sim_2", "sim_3", "desk")


def test_a_joined_router_gets_an_understudy() -> None:
    first = launches(plan(own_router=False))[0]
    assert first.name == "standby router"
    assert "--standby" in first.argv


def test_no_robots_and_no_host_leave_router_and_gateway() -> None:
    rows = launches(plan(robots=0, host_robot=""))
    assert [row.name for row in rows] == ["router", "gateway"]


def test_the_second_instance_counts_on() -> None:
    second = plan(first_robot=4, robots=2)
    assert second.simulated == ("sim_4", "sim_5")
    simulator = launches(second)[2].argv
    assert simulator[simulator.index("--first") + 1] == "4"
    assert simulator[simulator.index("--robots") + 1] == "2"


def test_the_host_leaves_the_simulated_robots_to_their_agents() -> None:
    host = launches(plan())[-1].argv
    assert host[host.index("--exclude") + 1] == "/sim_*/**"
    assert host[host.index("--namespace") + 1] == "/"
    assert "--host-metrics" in host


def test_each_agent_keeps_to_its_namespace_without_host_metrics() -> None:
    agent = launches(plan())[4].argv
    assert agent[agent.index("--name") + 1] == "sim_2"
    assert agent[agent.index("--namespace") + 1] == "/sim_2"
    assert "--no-host-metrics" in agent


def test_each_agent_has_a_state_directory_of_its_own_that_the_next_run_goes_on_with() -> None:
    agents = [row.argv for row in launches(plan()) if row.name.startswith("agent")]
    places = [argv[argv.index("--state-dir") + 1] for argv in agents]
    assert places == [str(Path("/data/agents") / name) for name in plan().robot_names]


def test_a_camera_is_one_more_process() -> None:
    row = launches(plan(camera="test"))[-1]
    assert row.name == "camera"
    assert "source=test" in row.argv
    assert "camera" not in [row.name for row in launches(plan(camera="test", host_robot=""))]


def test_every_process_is_in_the_domain() -> None:
    assert {row.env["ROS_DOMAIN_ID"] for row in launches(plan(domain=7))} == {"7"}


@cases(
    ("hostname", "name"),
    [
        ("desk", "desk"),
        ("My-Laptop.local", "my_laptop"),
        ("10-0-0-7", "host_10_0_0_7"),
        ("sim_1", "host_sim_1"),
        ("", "host"),
        ("---", "host"),
        ("büro", "b_ro"),
    ],
)
def test_a_host_name_becomes_a_robot_name(hostname: str, name: str) -> None:
    assert host_robot_name(hostname) == name


@cases(
    ("names", "first"),
    [
        ([], 1),
        (["desk", "/", "/host"], 1),
        (["sim_1", "sim_2", "sim_3"], 4),
        (["/sim_1", "/sim_7/base"], 8),
        (["/sim_x", "/simulator", "/other/sim_9"], 1),
        (["/sim_12/odom"], 13),
    ],
)
def test_numbering_goes_on_after_the_highest(names: list[str], first: int) -> None:
    assert first_free_robot(names) == first


@cases(
    ("host", "url"),
    [("127.0.0.1", "http://127.0.0.1:8080"), ("0.0.0.0", "http://127.0.0.1:8080"), ("::1", "http://[::1]:8080")],
)
def test_the_url_is_one_that_a_browser_on_this_machine_can_open(host: str, url: str) -> None:
    assert plan(host=host).url == url


def test_in_the_protected_profile_only_agents_may_drive() -> None:
    open_rows = launches(plan(camera="test"))
    assert not any("ZENOH_SESSION_CONFIG_URI" in row.env or "--zenoh-profile" in row.argv for row in open_rows)
    rows = {row.name: row for row in launches(plan(camera="test", protected=Path("/secret")))}
    for name in ("router", "agent sim_1", "agent desk"):
        argv = rows[name].argv
        assert argv[argv.index("--zenoh-profile") + 1] == "protected"
        assert argv[argv.index("--zenoh-credentials") + 1] == "/secret"
    for name in ("sim", "camera"):
        assert rows[name].env["ZENOH_SESSION_CONFIG_URI"] == "/secret/node.json5"
    assert "--zenoh-profile" not in rows["gateway"].argv


def test_replicas_share_store_objects_key_and_router_and_robots_spread_over_them() -> None:
    made = plan(
        database="postgresql://u:secret@h/d",
        replicas=(Replica(2, 8180, 8181), Replica(3, 8280, 8281)),
        cluster_port=7457,
    )
    rows = {row.name: row for row in launches(made)}
    assert [name for name, row in rows.items() if row.stage <= 1] == [
        "router",
        "cluster router",
        "gateway",
        "gateway 2",
        "gateway 3",
    ]
    gateways = [rows[name] for name in ("gateway", "gateway 2", "gateway 3")]
    for flag in ("--cluster", "--objects", "--master-key"):
        assert len({row.argv[row.argv.index(flag) + 1] for row in gateways}) == 1
    assert len({row.argv[row.argv.index("--data-dir") + 1] for row in gateways}) == 3
    assert not any("secret" in word for row in rows.values() for word in row.argv)
    assert [name for name, row in rows.items() if row.env.get("METAROS_STORE")] == ["gateway", "gateway 2", "gateway 3"]
    first = [rows[f"agent {name}"].argv for name in made.robot_names]
    links = [argv[argv.index("--gateway") + 1].split(",") for argv in first]
    assert [len(set(link)) for link in links] == [3] * 4
    assert [link[0] for link in links] == ["127.0.0.1:8081", "127.0.0.1:8181", "127.0.0.1:8281", "127.0.0.1:8081"]
