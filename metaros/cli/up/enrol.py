"""With TLS the agents' link knows robots by their certificates, so `metaros up` enrols its own robots at its gateway.

At every start, each with a token for this one robot: its ports may be others than the last time, and a robot remembers
where it was enrolled.
"""

from __future__ import annotations

import asyncio
import json
import sys
from typing import TYPE_CHECKING

from metaros.access.trust import open_connection
from metaros.cli.up.local_access import local_key
from metaros.errors import UnavailableError

if TYPE_CHECKING:
    from metaros.cli.up.launch_table import Plan

__all__ = ["enrol_robots"]

AT_ONCE = 4
TIMEOUT_S = 60.0


async def enrol_robots(plan: Plan) -> None:
    """Give every robot of this instance its identity.

    Raises:
        UnavailableError: one of them got none.
    """
    room = asyncio.Semaphore(AT_ONCE)

    async def one(robot: str) -> None:
        async with room:
            await _enrol(plan, robot, await asyncio.to_thread(_token, plan, robot))

    try:
        async with asyncio.TaskGroup() as group:
            for robot in plan.robot_names:
                group.create_task(one(robot))
    except* UnavailableError as errors:
        raise errors.exceptions[0] from None


def _token(plan: Plan, robot: str) -> str:
    """A token for that robot alone."""
    connection = open_connection(plan.url, timeout_s=TIMEOUT_S, ca=plan.root_file)
    headers = {"Content-Type": "application/json", "Authorization": f"Bearer {local_key(plan)}"}
    try:
        body = json.dumps({"robot": robot, "ttl_s": 300})
        connection.request("POST", "/api/v1/enrolment-tokens", body=body, headers=headers)
        return str(json.loads(connection.getresponse().read())["token"])
    except (OSError, ValueError, TypeError, KeyError) as error:
        raise UnavailableError(f"the gateway gives no token for {robot}: {error}") from error
    finally:
        connection.close()


async def _enrol(plan: Plan, robot: str, token: str) -> None:
    where = ("--gateway", plan.url, "--name", robot, "--state-dir", str(plan.data_dir / "agents" / robot))
    process = await asyncio.create_subprocess_exec(
        *(sys.executable, "-m", "metaros", "agent", "enrol", "-", *where),  # the token is not for `ps`
        stdin=asyncio.subprocess.PIPE,
        stdout=asyncio.subprocess.PIPE,
        stderr=asyncio.subprocess.STDOUT,
    )
    try:
        async with asyncio.timeout(TIMEOUT_S):
            said, _ = await process.communicate(token.encode() + b"\n")
    except TimeoutError:
        raise UnavailableError(f"{robot} was not enrolled within {TIMEOUT_S:.0f} s") from None
    finally:
        if process.returncode is None:
            process.kill()
            await process.wait()
    if process.returncode:
        raise UnavailableError(f"{robot} was not enrolled: {said.decode(errors='replace').strip()}")
