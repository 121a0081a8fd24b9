"""The units: systemd takes them, their options are those of the programs, and what they shut does not break functions.

Nothing is started by systemd here. The units are read, and `systemd-analyze` says what it thinks of them.
"""

from __future__ import annotations

import re
import shutil
import subprocess
from pathlib import Path

import pytest

from tests.support.deployment.deployed import options_of, settings_of

ROOT = Path(__file__).resolve().parents[2]
UNITS = ROOT / "deploy" / "systemd"
NAMES = sorted(path.stem for path in UNITS.glob("*.service"))
# Exposure that `systemd-analyze security` may say at most, times ten. Nodes drive hardware: they are hardly shut in.
EXPOSED = {"metaros-agent": 25, "metaros-gateway": 35, "metaros-router": 20, "metaros-supervisor": 80}
WORST_WITHOUT_FUNCTIONS = 20


def unit(path: Path) -> dict[str, list[str]]:
    """Each key of a unit with its values, in their order."""
    found: dict[str, list[str]] = {}
    for line in path.read_text().splitlines():
        if "=" in line and line[0] != "#":
            key, value = line.split("=", 1)
            found.setdefault(key, []).append(value)
    return found


def service(name: str) -> dict[str, list[str]]:
    """A unit of ours."""
    return unit(UNITS / f"{name}.service")


def environment(name: str) -> dict[str, str]:
    """The values of an example of an environment file, also those that are commented out."""
    text = (UNITS / name).read_text()
    return dict(re.findall(r"^(?:# )?([A-Za-z_]+)=(.*)$", text, re.MULTILINE))


def words(name: str) -> list[str]:
    """What a unit starts, with the options of its example of an environment file."""
    (line,) = service(name)["ExecStart"]
    given = environment("gateway.env" if "gateway" in name else "agent.env")
    line = re.sub(r"\$(\w+)", lambda match: given[match[1]], line)
    program, *options = line.split()
    assert program == "/opt/metaros/bin/metaros"
    return options


def seconds(text: str) -> float:
    """ "15min" as a number."""
    unit = {"min": 60.0, "s": 1.0, "": 1.0}
    match = re.fullmatch(r"(\d+)(\w*)", text)
    assert match
    return int(match[1]) * unit[match[2]]


def test_there_are_units_for_the_gateway_and_for_a_robot() -> None:
    assert set(NAMES) == set(EXPOSED)


@pytest.mark.parametrize("name", NAMES)
def test_what_it_starts_is_a_command_with_these_options(name: str) -> None:
    expected = "agent" if name == "metaros-agent" else name.removeprefix("metaros-")
    assert options_of(words(name))[0] == expected


def test_the_gateways_settings_hold_together() -> None:
    store = environment("gateway.env")["METAROS_STORE"]
    made = settings_of(
        words("metaros-gateway"), store_url=store, objects_url=environment("gateway.env")["METAROS_OBJECTS"]
    )
    assert made.tls_on
    assert made.enrolled_only
    assert made.sandbox_require == "L2"
    keys = service("metaros-gateway")
    assert keys["Type"] == ["notify"]
    assert seconds(keys["TimeoutStopSec"][0]) > made.drain_notice_s + 2 * made.drain_s + 25
    (state,) = keys["StateDirectory"]
    assert str(made.data_dir).startswith(f"/var/lib/{state}/")


def test_variables_are_read_by_somebody() -> None:
    from tests.layout.test_docs import command_tree

    known = {getattr(option, "envvar", None) for _, command in command_tree() for option in command.params}
    started = {match for name in NAMES for match in re.findall(r"\$(\w+)", service(name)["ExecStart"][0])}
    for name in ("gateway.env", "agent.env"):
        ours = {key for key in environment(name) if key.startswith("METAROS_")}
        assert ours <= known | started, name


def test_the_agents_example_is_a_config() -> None:
    from edge_agent.config.settings import load_settings

    made = load_settings(UNITS / "agent.toml")
    assert environment("agent.env")["METAROS_SUPERVISOR_OPTIONS"].split()[-1] == made.name


@pytest.mark.parametrize("name", NAMES)
def test_it_comes_back_is_bounded_and_nobody_special(name: str) -> None:
    keys = service(name)
    assert keys["Restart"] == ["always"]
    assert keys["StartLimitIntervalSec"] == ["0"], "it never gives up"
    assert keys["User"] == keys["Group"] == ["metaros"]
    assert keys["NoNewPrivileges"] == ["yes"]
    assert keys["MemoryMax"]
    assert keys["UMask"] == ["0077"]
    assert keys["ProtectSystem"][0] in ("strict", "full")


def test_an_update_of_the_agent_leaves_the_nodes_alone() -> None:
    agent = service("metaros-agent")
    assert "metaros-supervisor.service" in agent["Wants"][0]
    assert not {"Requires", "BindsTo", "PartOf"} & set(agent) & set(service("metaros-supervisor"))
    assert options_of(words("metaros-supervisor"))[1]["name"] == options_of(["agent", "--name", "arm_1"])[1]["name"]


def test_the_sandbox_of_functions_has_what_it_needs() -> None:
    keys = service("metaros-gateway")
    breaks = {"RestrictNamespaces", "ProtectKernelTunables", "ProtectKernelLogs", "ProtectProc", "ProcSubset"}
    assert not breaks & set(keys), "each covers a part of /proc or refuses namespaces: no room of its own then"
    assert "@mount" in keys["SystemCallFilter"][0].split()
    shut = unit(UNITS / "metaros-gateway-no-functions.conf")
    assert breaks <= set(shut)
    assert "~@mount" in shut["SystemCallFilter"][0]


needs_systemd = pytest.mark.skipif(shutil.which("systemd-analyze") is None, reason="no systemd on this machine")


@needs_systemd
@pytest.mark.parametrize("name", NAMES)
def test_systemd_takes_the_unit(name: str, tmp_path: Path) -> None:
    for path in UNITS.glob("*.service"):
        (tmp_path / path.name).write_text(re.sub(r"/opt/metaros/bin/metaros", "/bin/true", path.read_text()))
    if name == "metaros-gateway":
        (tmp_path / f"{name}.service.d").mkdir()
        shutil.copy(UNITS / "metaros-gateway-no-functions.conf", tmp_path / f"{name}.service.d")
    command = ["systemd-analyze", "verify", "--man=no", str(tmp_path / f"{name}.service")]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    said = [line for line in done.stderr.splitlines() if "metaros" in line]
    assert said == []


@needs_systemd
@pytest.mark.parametrize("name", NAMES)
def test_it_is_shut_in_as_far_as_we_say(name: str) -> None:
    assert 0 < exposure(UNITS / f"{name}.service") <= EXPOSED[name]


@needs_systemd
def test_without_functions_the_gateway_is_shut_in_further(tmp_path: Path) -> None:
    joined = tmp_path / "metaros-gateway.service"
    added = (UNITS / "metaros-gateway-no-functions.conf").read_text()
    joined.write_text((UNITS / joined.name).read_text().replace("[Install]", f"{added}\n[Install]"))
    assert 0 < exposure(joined) <= WORST_WITHOUT_FUNCTIONS


def exposure(path: Path) -> int:
    """What `systemd-analyze security` says of a unit, times ten."""
    command = ["systemd-analyze", "security", "--offline=yes", "--threshold=100", "--no-pager", str(path)]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    match = re.search(r"exposure level for \S+: (\d+)\.(\d)", done.stdout)
    if match is None and "offline" in done.stderr:
        pytest.skip("this systemd looks at no files by themselves (older than 250)")
    assert match, done.stderr
    return 10 * int(match[1]) + int(match[2])
