"""Random edits of twins in a testbed with faults, and a model of the final state."""

from __future__ import annotations

import asyncio
from pathlib import Path
from random import Random  # noqa: TID251 - the type of an argument

from gateway.fleet.twins.manager import Editor
from gateway.fleet.twins.plan import Edit
from tests.gateway.fleet.twin_model import Model, Step, random_step
from tests.support.processes.fast_loop import SPEED
from tests.support.robots.twin_testbed import FAULTS, JAM, NOT_ALLOWED, Agent, Testbed

__all__ = ["ROBOTS", "Edits"]

ROBOTS = {"a1": "lab", "a2": "lab", "b1": "hall", "b2": "hall"}
BURST_S = 3.0
LOST_S = 0.2
WINDOWS_S = (2.0, 10.0, 60.0, 60.0)
ENOUGH_S = 600.0  # a window that no busy machine lets pass
WITHIN_S = 60.0  # of the machine's seconds
HARM = {"jam": {"nodes": {"jam": {"allowed": JAM}}}, "forbid": {"nodes": {"bad": {"allowed": NOT_ALLOWED}}}}
LAST = {"parameters": {"n0": {"last": True}}}
REMEDY = {"jam": {"nodes": {"jam": None}}, "forbid": {"nodes": {"bad": None}}}


class Edits:
    """A world, and a model of what it is to be."""

    def __init__(self, folder: Path, rng: Random) -> None:
        self.rng = rng
        self.world = Testbed(folder, rng, ROBOTS)
        self.model = Model(ROBOTS, rng)

    async def burst(self, edits: int, faults: int) -> None:
        """So many edits at once, of which those of one template follow each other, and so many faults among them."""
        steps = [random_step(self.rng, ROBOTS) for _ in range(edits)]
        async with asyncio.TaskGroup() as group:
            for step in steps:
                if "template" not in step[0]:
                    group.create_task(self._edit([step]))
            for site in {step[1] for step in steps if "template" in step[0]}:
                group.create_task(self._edit([step for step in steps if "template" in step[0] and step[1] == site]))
            for _ in range(faults):
                group.create_task(self._fault(self.rng.choice(FAULTS), self.rng.choice(sorted(ROBOTS))))

    async def converge(self) -> None:
        """Everything works again, and who went back is told once more: then all is as the model says, really so."""
        for patch in REMEDY.values():
            for name in ROBOTS:
                await self.model.patch(self.world.twins, name, patch)
        for name, agent in self.world.agents.items():  # what is told last gets lost on its way, and nobody edits again
            await self.model.patch(self.world.twins, name, LAST)
            await asyncio.sleep(self.rng.random() * LOST_S)
            agent.cut()
        loop = asyncio.get_running_loop()
        end_s = loop.time() + WITHIN_S * SPEED
        while missing := await self._missing():
            assert loop.time() < end_s, missing
            await asyncio.sleep(1.0)

    async def _edit(self, steps: list[Step]) -> None:
        for step in steps:
            await asyncio.sleep(self.rng.random() * BURST_S)
            await self.model.edit(self.world.twins, step, window_s=self.rng.choice(WINDOWS_S))

    async def _fault(self, kind: str, name: str) -> None:
        await asyncio.sleep(self.rng.random() * BURST_S)
        if kind not in HARM:
            await self.world.fault(kind, name)
            return
        self.world.faults[kind] += 1
        await self.model.patch(self.world.twins, name, HARM[kind])
        await asyncio.sleep(self.rng.random() * 2 * BURST_S)
        await self.model.patch(self.world.twins, name, REMEDY[kind])

    async def _missing(self) -> dict[str, str]:
        """What is not yet as it has to be, by robot; whoever went back is told again."""
        self.world.check()
        found = {name: await self._lacks(name, agent) for name, agent in self.world.agents.items()}
        return {name: text for name, text in found.items() if text}

    async def _lacks(self, name: str, agent: Agent) -> str:
        desired, confirm = self.world.twins.manager.desired_of(name), agent.confirm
        wanted = self.model.document(name)
        if desired is None or not desired.revision:
            return "" if confirm.active_version.document == wanted == b"{}" else "nobody desires anything of it"
        assert desired.document == wanted, f"an edit of {name} is lost, or came twice"
        if (confirm.state, confirm.active_version.document) != ("applied", wanted):
            if agent.online and confirm.revision == desired.revision and confirm.state in ("reverted", "refused"):
                again = Editor(name="ada", code=True, confirm_within_s=ENOUGH_S)
                await self.world.twins.manager.edit(name, Edit(again=True), again, dry_run=False)
            link = "online" if agent.online else "offline"
            return f"{link}, {confirm.state} {confirm.revision} of {desired.revision}: {confirm.why}"
        if left := agent.unlike(wanted):
            return f"lives otherwise: {left}"
        state = await self.world.twins.manager.state(name)
        return "" if state.in_step and not state.behind else f"its gateway has heard of {state.reported}"
