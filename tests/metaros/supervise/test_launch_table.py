"""Launch tables: what they mean, and what is said of those that mean nothing."""

from __future__ import annotations

from pathlib import Path

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from metaros.errors import ConfigError
from metaros.supervise.launch_table import LaunchTable, parse_table, read_table
from metaros.supervise.restart_policy import Restart, RestartPolicy
from tests.support.tables import cases

HERE = Path("/somewhere/robot.toml")


def parse(text: str) -> LaunchTable:
    return parse_table(text, HERE)


def test_a_whole_table() -> None:
    table = parse("""
        safe_stop = ["stop", "--now"]
        heartbeat_s = 1.5
        env = { A = "1" }
        [[node]]
        name = "camera"
        module = "pkg.camera"
        namespace = "robot/front"
        args = ["--fast"]
        parameters = { rate = 2.5, lens = { f = 1.8 }, names = ["a", "b"] }
        remap = { image = "/image" }
        nice = 5
        critical = true
        restart = { when = "on-failure", exits = 3, base_delay_s = 0.5 }
        after = ["base"]
        rest_for_one = true
        [[node]]
        name = "base"
        class = "pkg.base:Base.Inner"
        heartbeat = false
        [[node]]
        name = "bag"
        command = ["ros2", "bag", "record"]
        restart = "never"
    """)
    base, camera, bag = sorted(table.nodes, key=lambda row: ["base", "camera", "bag"].index(row.name))
    assert [row.name for row in table.nodes] == ["base", "camera", "bag"]
    assert (table.safe_stop, table.heartbeat_s, table.env) == (("stop", "--now"), 1.5, {"A": "1"})
    assert (camera.module, camera.namespace, camera.args) == ("pkg.camera", "/robot/front", ("--fast",))
    assert camera.parameters == {"rate": 2.5, "lens.f": 1.8, "names": ["a", "b"]}
    assert camera.policy == RestartPolicy(restart=Restart.ON_FAILURE, critical=True, window_exits=3, base_delay_s=0.5)
    assert (camera.after, camera.rest_for_one, camera.nice) == (("base",), True, 5)
    assert (base.class_, base.heartbeat, base.policy) == ("pkg.base:Base.Inner", False, RestartPolicy())
    assert (bag.command, bag.policy.restart) == (("ros2", "bag", "record"), Restart.NEVER)


NODE = '[[node]]\nname = "a"\nmodule = "m"\n'


@cases(
    ("text", "said"),
    [
        ("", "robot.toml: no [[node]] in it"),
        ("[[node]\n", "robot.toml: no TOML"),
        ("node = 3", "robot.toml: node: expected a list"),
        ("nodes = []", "robot.toml: unknown key 'nodes'; did you mean 'node'?"),
        ('[[node]]\nmodule = "m"', "robot.toml: [[node]] 1: name: every node needs one"),
        ('[[node]]\nname = "a b"\nmodule = "m"', "[[node]] 'a b': name"),
        (
            '[[node]]\nname = "a"',
            "[[node]] 'a': exactly one of module, class, driver, ros2, command says what to run; found none",
        ),
        (NODE + 'command = ["x"]', "found module and command"),
        (NODE + "moduel = 1", "[[node]] 'a': unknown key 'moduel'; did you mean 'module'?"),
        ('[[node]]\nname = "a"\nmodule = "m:C"', "[[node]] 'a': module: 'm:C' does not look like package.module"),
        ('[[node]]\nname = "a"\nclass = "m"', "class: 'm' does not look like package.module:Class"),
        ('[[node]]\nname = "a"\ncommand = []', "command: expected a program"),
        ('[[node]]\nname = "a"\ncommand = [1]', "command: expected a list of texts, found a whole number in it"),
        ('[[node]]\nname = "a"\nros2 = "a b c"', "ros2: 'a b c' does not look like talker.py"),
        (NODE + NODE, "[[node]] 'a': name: another node has it already"),
        (NODE + 'after = ["b"]', "[[node]] 'a': after: there is no node 'b'"),
        (NODE + 'after = ["a"]', "after: a circle: a → a"),
        (NODE + "rest_for_one = true", "rest_for_one: it needs `after`"),
        (NODE + "nice = 20", "nice: 20 is not within -20 to 19"),
        (NODE + "nice = true", "nice: expected a whole number, not true or false"),
        (NODE + 'critical = "yes"', "critical: expected true or false, not a text"),
        (NODE + 'restart = "sometimes"', "restart: when: 'sometimes' is none of always, on-failure, never"),
        (NODE + "restart = { exit = 1 }", "restart: unknown key 'exit'; did you mean 'exits'?"),
        (NODE + "restart = { max_delay_s = nan }", "restart: max_delay_s: nan is not within"),
        (NODE + 'parameters = "none.yaml"', "parameters: there is no file"),
        (NODE + "parameters = { a = 2020-01-01 }", "parameters: a: date is no parameter value"),
        (NODE + "parameters = 3", "parameters: expected a table, or the path of a parameter file"),
        (NODE + "remap = { a = 1 }", "remap: 'a': expected names"),
        (NODE + 'remap = { __node = "b" }', "remap: '__node'"),
        (NODE + "env = { A = 1 }", "env: 'A': expected a text"),
        (NODE + 'namespace = "a//b"', "namespace: 'a//b' does not look like"),
        ("heartbeat_s = 0\n" + NODE, "heartbeat_s: 0 is not within"),
    ],
)
def test_what_is_wrong_is_named(text: str, said: str) -> None:
    with pytest.raises(ConfigError) as raised:
        parse(text)
    assert said in str(raised.value)
    assert str(raised.value).startswith("robot.toml: ")


def test_a_circle_is_shown() -> None:
    rows = [f'[[node]]\nname = "{name}"\nmodule = "m"\nafter = ["{after}"]\n' for name, after in ("ab", "bc", "ca")]
    with pytest.raises(ConfigError, match=r"a circle: . → . → . → .; one of them must start first"):
        parse("".join(rows))


def test_too_many_nodes_and_too_large_files_are_refused(tmp_path: Path) -> None:
    with pytest.raises(ConfigError, match="257 nodes"):
        parse("".join(f'[[node]]\nname = "n{number}"\nmodule = "m"\n' for number in range(257)))
    path = tmp_path / "large.toml"
    path.write_bytes(b"#" * (1024 * 1024 + 1))
    with pytest.raises(ConfigError, match="at most 1048576 bytes"):
        read_table(path)


def test_files_that_cannot_be_read(tmp_path: Path) -> None:
    with pytest.raises(ConfigError, match=r"none\.toml: No such file"):
        read_table(tmp_path / "none.toml")
    path = tmp_path / "latin.toml"
    path.write_bytes(b"# \xff")
    with pytest.raises(ConfigError, match="not UTF-8"):
        read_table(path)


def test_a_parameter_file_is_found_beside_the_table(tmp_path: Path) -> None:
    (tmp_path / "p.yaml").write_text("{}")
    path = tmp_path / "robot.toml"
    path.write_text(NODE + 'parameters = "p.yaml"')
    (row,) = read_table(path).nodes
    assert row.parameter_file == tmp_path / "p.yaml"


VALUES = st.recursive(
    st.booleans() | st.integers(-100, 100) | st.floats() | st.text("ab/:=~ _", max_size=6),
    lambda inner: st.lists(inner, max_size=3) | st.dictionaries(st.text("ab_", min_size=1, max_size=4), inner),
    max_leaves=4,
)
KEYS = ("name", "module", "class", "command", "args", "parameters", "remap", "after", "restart", "nice", "env", "x")


def toml(value: object) -> str:
    if isinstance(value, dict):
        return "{" + ", ".join(f'"{key}" = {toml(item)}' for key, item in value.items()) + "}"
    if isinstance(value, list):
        return f"[{', '.join(map(toml, value))}]"
    if isinstance(value, str):
        return f'"{value}"'
    return {True: "true", False: "false"}[value] if isinstance(value, bool) else str(value)


@settings(max_examples=40)
@given(st.lists(st.dictionaries(st.sampled_from(KEYS), VALUES, max_size=4), max_size=3))
def test_any_table_is_taken_or_refused_with_its_name(nodes: list[dict[str, object]]) -> None:
    text = "".join("[[node]]\n" + "".join(f"{key} = {toml(value)}\n" for key, value in node.items()) for node in nodes)
    said = ""
    try:
        parse(text)
    except ConfigError as error:
        said = str(error)
    assert not said or said.startswith("robot.toml: ")
