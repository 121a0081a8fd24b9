"""What the API's documents are made from. Pydantic builds a model when it is first used, and not when it is imported:
most of them only describe answers, and hundreds would hold up every start of a gateway.
"""

from __future__ import annotations

from pydantic import BaseModel, ConfigDict

__all__ = ["Exact", "Model"]


class Model(BaseModel):
    """What it does not know is left."""

    model_config = ConfigDict(defer_build=True)


class Exact(Model):
    """What it does not know is refused."""

    model_config = ConfigDict(extra="forbid")
