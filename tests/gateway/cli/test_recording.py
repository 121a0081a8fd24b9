"""`metaros recording` against a real gateway with a scripted robot."""

from __future__ import annotations

import asyncio
import json
from pathlib import Path

import pytest

from gateway.main import Ready
from metaros.cli.shared.gateway_http import GatewayClient
from metaros.errors import ConfigError, UnavailableError
from tests.gateway.harness import OPERATOR_KEY, running_gateway
from tests.gateway.history.recordings.robot import RecordingRobot, content
from tests.support.processes.command_line import ask_metaros

BLOB = content(700_000)


async def metaros(ready: Ready, *arguments: str, folder: Path) -> tuple[int, str, str]:
    """Run it; exit code, standard output, standard error."""
    environ = {"METAROS_GATEWAY_URL": ready.url, "METAROS_KEY": OPERATOR_KEY, "http_proxy": "http://127.0.0.1:9"}
    return await ask_metaros("recording", *arguments, folder=folder, **environ)


async def test_save_list_get_delete(tmp_path: Path) -> None:
    async with running_gateway(tmp_path) as ready, RecordingRobot(ready) as robot:
        saving = asyncio.create_task(
            metaros(ready, "save", "sim_1", "--last", "2m", "--topics", "/a/**", folder=tmp_path)
        )
        command = await robot.asked()
        rid = command.save_recording.recording_id
        assert command.save_recording.last_ns == 120 * 10**9
        assert list(command.save_recording.topics) == ["/a/**"]
        await robot.answer(command)
        await robot.offer(rid, BLOB)
        assert (await robot.deliver(rid, BLOB)).stored
        code, out, err = await saving
        assert (code, out) == (0, f"{rid}\n"), err
        code, out, _ = await metaros(ready, "list", "--output", "json", folder=tmp_path)
        assert [(item["id"], item["state"]) for item in json.loads(out)] == [(rid, "stored")]
        code, out, _ = await metaros(ready, "list", "sim_1", folder=tmp_path)
        assert out.split()[:3] == [rid, "sim_1", "stored"]
        code, out, err = await metaros(ready, "get", rid, folder=tmp_path)
        assert (code, out) == (0, "sim_1_1970-01-01T00-00-05Z.mcap\n"), err
        assert (tmp_path / out.strip()).read_bytes() == BLOB
        assert (await metaros(ready, "delete", rid, folder=tmp_path))[0] == 0
        code, _, err = await metaros(ready, "get", rid, folder=tmp_path)
        assert code == 1
        assert "there is no recording" in err


@pytest.mark.parametrize("have", [1000, len(BLOB)])
async def test_a_download_goes_on_and_a_damaged_one_is_reported(tmp_path: Path, have: int) -> None:
    async with running_gateway(tmp_path) as ready, RecordingRobot(ready) as robot:
        answer = await asyncio.to_thread(
            GatewayClient(ready.url, key=OPERATOR_KEY).post, "/api/v1/robots/sim_1/recordings", {"last_s": 60}
        )
        await robot.offer(answer["id"], BLOB)
        await robot.deliver(answer["id"], BLOB)
        item = await asyncio.to_thread(
            GatewayClient(ready.url, key=OPERATOR_KEY).get, f"/api/v1/recordings/{answer['id']}"
        )
        partial = tmp_path / f"x.mcap.{item['sha256'][:8]}.partial"
        partial.write_bytes(b"?" + BLOB[1:have])  # its first byte is wrong: what it has is not fetched again
        code, _, err = await metaros(ready, "get", answer["id"], "--file", "x.mcap", folder=tmp_path)
        assert code == 1
        assert "checksum" in err
        partial.write_bytes(BLOB[:have])
        assert (await metaros(ready, "get", answer["id"], "--file", "x.mcap", folder=tmp_path))[0] == 0
        assert (tmp_path / "x.mcap").read_bytes() == BLOB
        assert not partial.exists()


async def test_a_recording_that_fails_is_exit_code_1(tmp_path: Path) -> None:
    async with running_gateway(tmp_path) as ready, RecordingRobot(ready) as robot:
        saving = asyncio.create_task(metaros(ready, "save", "sim_1", folder=tmp_path))
        await robot.answer(await robot.asked(), code="black_box_off")
        code, _, err = await saving
        assert code == 1
        assert "black_box_off" in err


@pytest.mark.parametrize(
    ("arguments", "code", "text"),
    [
        (("save", "nobody"), 1, "nobody"),
        (("save", "sim_1", "--last", "soon"), 2, "not a span"),
        (("save", "sim_1", "--last", "1m", "--start", "-2m"), 2, "either"),
        (("list", "--gateway", "ftp://x"), 2, "not the address"),
        (("list", "--gateway", "http://127.0.0.1:9"), 1, "no gateway answers"),
    ],
)
async def test_mistakes(tmp_path: Path, arguments: tuple[str, ...], code: int, text: str) -> None:
    async with running_gateway(tmp_path) as ready:
        got, _, err = await metaros(ready, *arguments, folder=tmp_path)
        assert (got, text in err) == (code, True), err


@pytest.mark.parametrize("url", ["http://", "ftp://host", "http://host:port", "//"])
def test_what_is_no_address(url: str) -> None:
    with pytest.raises(ConfigError):
        GatewayClient(url)


def test_nobody_answers(free_port: int) -> None:
    with pytest.raises(UnavailableError, match="metaros status"):
        GatewayClient(f"127.0.0.1:{free_port}").get("/healthz")
