"""What a relay saw of one session, as lines of text: `<ns> <who> <hex of what came>`, or `<ns> <who> end`.

`who` is the sender, `initiator` or `responder`; the order of the lines is the order in which the relay saw the bytes, before
it handed them on. So whatever a line answers stands above it.
"""
from dataclasses import dataclass
from pathlib import Path
from typing import Iterator, TextIO

HEAD = "# a session of ISE, version 1 of this file"
SIDES = ("initiator", "responder")


@dataclass
class Chunk:
    ns: int
    sender: str
    data: bytes | None  # None: this side ended its stream


def line_of(chunk: Chunk) -> str:
    return f"{chunk.ns} {chunk.sender} {'end' if chunk.data is None else chunk.data.hex()}\n"


class Recorder:
    """Writes one session, whole lines only."""

    def __init__(self, into: TextIO):
        self.into = into
        into.write(HEAD + "\n")

    def add(self, chunk: Chunk):
        self.into.write(line_of(chunk))


def read(file: Path) -> Iterator[Chunk]:
    """Throws ValueError that names the line."""
    with open(file, encoding="ascii") as lines:
        if next(lines, "").rstrip("\n") != HEAD:
            raise ValueError(f"{file} does not begin with '{HEAD}': it is no recorded session")
        for number, line in enumerate(lines, 2):
            words = line.split()
            try:
                ns, sender, data = words
                if sender not in SIDES:
                    raise ValueError
                yield Chunk(int(ns), sender, None if data == "end" else bytes.fromhex(data))
            except ValueError:
                raise ValueError(f"{file}, line {number}: '<ns> initiator|responder <hex>|end' is expected") from None
