"""What the checker keeps of a session: each side, its messages, and what was found."""
from dataclasses import dataclass, field
from typing import Any

from frames import LONGEST_HANDSHAKE, Frame, FrameReader


@dataclass
class Finding:
    """`grave`: FORMAT.md forbids it. Else it is allowed, but no sender of version 1 does it."""

    offset: int
    sender: str
    frame: str
    rule: str
    grave: bool = True

    def __str__(self) -> str:
        return f"{'violation' if self.grave else 'note'}: byte {self.offset} from the {self.sender}, {self.frame}: {self.rule}"


@dataclass
class Message:
    """One that comes in pieces."""

    type: int
    flags: int
    id: int
    size: int
    body: bytearray = field(default_factory=bytearray)


@dataclass
class UserPacket:
    """A packet of a service, decoded at the end, when all schemas are there."""

    side: "Side"
    frame: Frame
    what: str
    fingerprint: int
    data: bytes
    value: Any = None  # as JSON, once decoded
    decoded: bool = False


@dataclass
class Side:
    """What one side has said so far."""

    name: str
    reader: FrameReader = field(default_factory=FrameReader)
    greeting: dict[str, Any] | None = None  # hello or welcome
    messages: dict[int, Message] = field(default_factory=dict)
    last: str = ""  # the frame behind which nothing may come
    ended: bool = False
    broken: bool = False
    pings: list[int] = field(default_factory=list)  # not answered yet
    frames: dict[str, int] = field(default_factory=dict)  # how many of each type

    def accepts(self, limit: str) -> int:
        return self.greeting["accepts"][limit] if self.greeting else LONGEST_HANDSHAKE
