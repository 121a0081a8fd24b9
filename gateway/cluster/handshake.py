"""The handshake of two gateways: each has received a hello that confirms its own, since the connection was last lost.

Each counts its meetings with the other. A hello says the sender's count, and the receiver's as far as the sender has
heard it. Who is lost (its token went, or messages of its are missing) is met anew under the next count, and so the
other hears of it, too: both end what they had of each other and begin again. What was sent before belongs to an
earlier count, and is put aside.
"""

from __future__ import annotations

from gateway.cluster.wire import Kind, Message

__all__ = ["Handshake"]


class Handshake:
    """With one process of another gateway; no input or output of its own."""

    def __init__(self) -> None:
        self.mine = 1
        self.yours = 0  # 0: not heard yet
        self.there = False  # its token is
        self.met = False

    def token(self, there: bool) -> tuple[list[Message], bool | None]:
        """Its token came or went: what to send, and whether it has gone (False) as a peer."""
        self.there = there
        if there:
            return [self._hello()], None
        return [], self._end()

    def lost(self) -> tuple[list[Message], bool | None]:
        """Messages of its are missing: what to send, and whether it has gone (False) as a peer."""
        ended = self._end()
        return [self._hello()] if ended is not None else [], ended

    def hello(self, said: Message) -> tuple[list[Message], list[bool]]:
        """It said hello: what to answer, and what has become of it as a peer, in order: gone (False), come (True)."""
        became: list[bool] = []
        if said.mine < self.yours or not self.there:
            return [], became
        anew = said.mine > self.yours
        if anew and self.met:
            self.met = False
            became.append(False)
        self.yours = said.mine
        if said.yours == self.mine and not self.met:
            self.met = True
            became.append(True)
        waits = not said.number  # for ours: it has not met us
        return [self._hello()] if anew or waits or said.yours != self.mine else [], became

    def retry(self) -> list[Message]:
        """What to send now and then, as hellos may be lost."""
        return [self._hello()] if self.there and not self.met else []

    def holds(self, message: Message) -> bool:
        """Whether a message belongs to what the two have of each other now."""
        return self.met and (message.mine, message.yours) == (self.yours, self.mine)

    def _end(self) -> bool | None:
        if not self.met:
            return None
        self.met = False
        self.mine += 1
        return False

    def _hello(self) -> Message:
        return Message(Kind.HELLO, self.mine, self.yours, number=int(self.met))
