"""A node with a fault."""

from __future__ import annotations

import metaros

with metaros.Node("crasher"):
    raise RuntimeError("the motor does not answer")
