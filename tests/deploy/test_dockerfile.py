"""The image's recipe: what it copies, installs and starts is there, and its commands do what they say.

No image is built here, as there is no engine that could: the recipe is read, and its commands run in folders of a test.
"""

from __future__ import annotations

import asyncio
import fnmatch
import json
import os
import re
import shutil
import subprocess
import sys
import tomllib
import zipfile
from pathlib import Path

import pytest

from gateway import settings
from tests.gateway.test_drain import ending_gateway
from tests.support.deployment.deployed import settings_of
from tests.support.ports import free_port

ROOT = Path(__file__).resolve().parents[2]
DEPLOY = ROOT / "deploy"
LEFT_OUT = ("--no-cache", "--compile-bytecode")  # what takes half of the time, and changes nothing of what is installed
PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]


def instructions() -> list[tuple[str, str]]:
    """The recipe's lines, continued ones joined: ("RUN", "pip install …")."""
    text = re.sub(r"^#.*\n", "", (DEPLOY / "Dockerfile").read_text(), flags=re.MULTILINE)
    lines = re.sub(r"\\\n\s*", "", text).splitlines()
    return [(line.split()[0], line.split(maxsplit=1)[1].strip()) for line in lines if line.strip()]


def stages() -> dict[str, list[tuple[str, str]]]:
    """The instructions of each stage; the last one is called "final"."""
    found: dict[str, list[tuple[str, str]]] = {}
    for name, text in instructions():
        if name == "FROM":
            stage = text.split(" AS ")[1] if " AS " in text else "final"
            found[stage] = []
        found[stage].append((name, text))
    return found


def of(stage: str, name: str) -> list[str]:
    """What a stage says by one instruction."""
    return [text for said, text in stages()[stage] if said == name]


def context() -> list[str]:
    """The files of git, and those that nobody has added yet, that .dockerignore lets into the build."""
    rules = [line for line in (ROOT / ".dockerignore").read_text().splitlines() if line and line[0] != "#"]
    command = ["git", "ls-files", "-z", "--cached", "--others", "--exclude-standard"]
    listed = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=True).stdout
    return [name for name in listed.split("\0") if name and _let_in(name, rules) and (ROOT / name).is_file()]


def _let_in(name: str, rules: list[str]) -> bool:
    """The last rule that fits decides; a rule fits a path when it fits it or a folder above it."""
    parents = ["/".join(name.split("/")[:depth]) for depth in range(1, name.count("/") + 2)]
    inside = True
    for rule in rules:
        pattern = rule.removeprefix("!").removeprefix("**/")
        if any(fnmatch.fnmatchcase(parent, pattern) for parent in parents):
            inside = rule.startswith("!")
    return inside


def test_the_context_holds_what_the_wheel_is_made_of_and_no_more() -> None:
    files = context()
    tops = {name.split("/")[0] for name in files}
    asked = {"pyproject.toml", "requirements.lock", "README.md", "LICENSE", "metaros", "edge_agent", "gateway"}
    assert asked <= tops
    assert {"tools/hatch_build.py", "tools/dashboard.py", "dashboard/package-lock.json"} <= set(files)
    assert tops.isdisjoint({"tests", ".git", "docs", "load_tests", ".venv"})
    named = [line[1:] for line in (ROOT / ".dockerignore").read_text().splitlines() if line.startswith("!")]
    assert [name for name in named if not (ROOT / name).exists()] == []


def test_what_it_copies_is_there() -> None:
    files = context()
    for stage in stages():
        for text in of(stage, "COPY"):
            source = text.split()
            if source[0].startswith("--from="):
                assert source[0].removeprefix("--from=") in stages()
                continue
            assert source[0] == "." or source[0] in files, text
    assert not [text for name, text in instructions() if name == "ADD"]


def test_images_are_plain_names_of_a_python_that_we_support() -> None:
    for name in stages():
        image = of(name, "FROM")[0].split(" AS ")[0]
        if image in stages():
            continue
        found = re.fullmatch(r"python:3\.(\d+)-slim", image)
        assert found, image
        assert int(found[1]) >= int(PROJECT["requires-python"].removeprefix(">=3."))


def test_what_it_starts_is_a_script_of_the_wheel_that_takes_these_options() -> None:
    (entry,) = of("final", "ENTRYPOINT")
    (command,) = of("final", "CMD")
    assert json.loads(entry) == ["metaros"]
    assert "metaros" in PROJECT["scripts"]
    made = settings_of(json.loads(command))
    assert made.tls_on, "beyond loopback there is TLS"
    assert made.enrolled_only


def test_it_is_nobody_special_and_has_no_secrets() -> None:
    (user,) = of("final", "USER")
    assert re.fullmatch(r"[1-9]\d{3,}:[1-9]\d{3,}", user), "a number, so that Kubernetes sees that it is not root"
    assert not [text for name, text in instructions() if name == "ARG"]
    said = " ".join(text for name, text in instructions() if name in ("ENV", "LABEL", "COPY"))
    assert re.findall(r"(?i)password|secret|token|\.key|\.pem", said) == []


def test_ports_and_home_are_the_gateways() -> None:
    names = ("HTTP", "GRPC", "API_GRPC", "FOXGLOVE", "ROSBRIDGE")
    assert of("final", "EXPOSE") == [" ".join(str(getattr(settings, f"DEFAULT_{name}_PORT")) for name in names)]
    (home,) = of("final", "WORKDIR")
    assert any(f"HOME={home}" in text for text in of("final", "ENV"))
    assert any(f"install -d -o 10001 -g 10001 -m 0700 {home}" in text for text in of("final", "RUN"))


def test_extras_exist_and_the_wheels_pattern_fits_its_name() -> None:
    (text,) = of("installed", "RUN")
    extras = re.search(r"metaros\[([\w,]+)\]", text)
    assert extras
    assert set(extras[1].split(",")) <= set(PROJECT["optional-dependencies"])
    assert "dev" not in extras[1]
    pattern = re.search(r"ls /dist/(\S+)\)", text)
    assert pattern
    assert fnmatch.fnmatchcase(f"metaros-{PROJECT['version']}-py3-none-any.whl", pattern[1])


def test_the_health_check_is_in_the_image() -> None:
    (check,) = of("final", "HEALTHCHECK")
    words = json.loads(check[check.index("[") :])
    assert words == ["python", "/opt/metaros/healthcheck.py", str(settings.DEFAULT_HTTP_PORT)]
    assert any(text.endswith(words[1]) for text in of("final", "COPY"))


async def asked(port: int) -> tuple[int | None, str]:
    """The health check's exit code and what it said."""
    check = await asyncio.create_subprocess_exec(
        sys.executable, "-I", str(DEPLOY / "healthcheck.py"), str(port), stderr=asyncio.subprocess.PIPE
    )
    _, said = await check.communicate()
    return check.returncode, said.decode()


@pytest.mark.parametrize("tls", ["off", "on"])
async def test_the_health_check_asks_a_gateway(tls: str, tmp_path: Path) -> None:
    code, said = await asked(free_port())
    assert (code, "refused" in said) == (1, True)
    async with ending_gateway(tmp_path, tls=tls, drain_notice_s=600.0) as (ready, stop, _):
        answer = await asked(ready.http_port)
        while "timed out" in answer[1]:  # it waits four seconds; a container is asked again, too
            answer = await asked(ready.http_port)
        assert answer == (0, "")
        stop.set()
        while "503" not in answer[1]:
            answer = await asked(ready.http_port)
        assert answer[0] == 1


def test_what_the_install_below_leaves_out_is_an_option_of_uv() -> None:
    uv = Path(sys.executable).with_name("uv")
    asked = subprocess.run([uv, "pip", "install", "--help"], capture_output=True, text=True, check=True).stdout
    assert [option for option in LEFT_OUT if not re.search(rf"{option}\b", asked)] == []
    (install,) = of("installed", "RUN")
    assert [option for option in LEFT_OUT if f" {option} " not in install] == []


@pytest.mark.integration
@pytest.mark.skipif(sys.platform != "linux", reason="the image is Linux's")
@pytest.mark.timeout(900)
def test_its_commands_make_an_install_that_runs_from_a_read_only_root(tmp_path: Path) -> None:
    source = tmp_path / "src"
    for name in context():
        (source / name).parent.mkdir(parents=True, exist_ok=True)
        shutil.copy2(ROOT / name, source / name)
    # The dashboard as it was built here, so that the stage finds it up to date: CI has built it once already.
    shutil.copytree(ROOT / "gateway" / "static", source / "gateway" / "static")
    (uv_alone,) = of("base", "RUN")
    _shell(uv_alone.split(" && ")[0], tmp_path)
    assert re.fullmatch(r"uv==\S+ \\\n(    --hash=sha256:\S+( \\)?\n)+", (tmp_path / "uv.lock.txt").read_text())
    for stage in ("wheel", "installed"):
        for text in of(stage, "RUN"):
            _shell(text, tmp_path)
    (wheel,) = (tmp_path / "dist").iterdir()
    assert "gateway/static/index.html" in zipfile.ZipFile(wheel).namelist()
    _check_versions(tmp_path / "opt")
    _check_help(tmp_path)


def _shell(text: str, folder: Path) -> None:
    """A command of the recipe, in folders of the test, with uv's cache, and without what only saves time later."""
    for there, here in (("/build", "build"), ("/dist", "dist"), ("/opt/metaros", "opt"), ("/tmp/uv.", "uv.")):
        text = re.sub(rf"(?<![\w.]){re.escape(there)}", str(folder / here), text)
    for option in LEFT_OUT:
        text = text.replace(f" {option}", "")
    environment = {**os.environ, "PATH": f"{Path(sys.executable).parent}:{os.environ['PATH']}"}
    done = subprocess.run(
        ["sh", "-ec", text], cwd=folder / "src", env=environment, capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, f"{text}\n{done.stdout}{done.stderr}"


def _check_versions(environment: Path) -> None:
    """What was installed is in the lock, each in the version that it says: else no hash was looked at."""
    lock = set(re.findall(r"^([a-z0-9-]+==\S+)", (ROOT / "requirements.lock").read_text(), re.MULTILINE))
    (site,) = environment.glob("lib/python3.*/site-packages")
    found = {path.name.removesuffix(".dist-info") for path in site.glob("*.dist-info")}
    names = {re.sub(r"[-_.]+", "-", name.split("-")[0]).lower() + "==" + name.split("-")[1] for name in found}
    assert {name for name in names if not name.startswith("metaros==")} - lock == set()
    assert len(names) > 30


def _check_help(folder: Path) -> None:
    """As the image's user, with nothing of the machine writable but its home, and no rights."""
    home = folder / "home"
    home.mkdir()
    inside = (
        f"mount --bind {folder} {folder} && mount -o remount,bind,ro {folder} && mount -o remount,bind,ro / && "
        f"mount -t tmpfs tmpfs {home} && cd {home} && touch here && ! touch {folder}/no && ! touch /no && "
        "exec unshare -U --map-user=10001 --map-group=10001 setpriv --no-new-privs --bounding-set=-all "
        f"{folder}/opt/bin/metaros gateway --help"
    )
    command = ["unshare", "-Urm", "sh", "-ec", inside]
    environment = {"PATH": "/usr/sbin:/usr/bin:/sbin:/bin", "HOME": str(home), "COLUMNS": "200"}
    done = subprocess.run(command, env=environment, capture_output=True, text=True, check=False)
    if done.returncode and re.search(r"unshare: .*not permitted|mount: .*(permission|not mount point)", done.stderr):
        assert not os.environ.get("CI"), f"CI must be able to: {done.stderr.strip()}"
        pytest.skip(f"this machine gives no namespaces: {done.stderr.strip()}")
    assert done.returncode == 0, done.stderr
    assert "--sandbox-require" in done.stdout
