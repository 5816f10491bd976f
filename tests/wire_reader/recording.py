"""What a relay saw of one session, as lines of text: `<ns> <who> <hex of what came>`, or `<ns> <who> end`.

`who` is the sender, `initiator` or `responder`; the order of the lines is the order in which the relay saw the bytes, before
it handed them on. So whatever a line answers stands above it. Of datagrams each line is one; ` lost` behind it says that the
relay did not hand it on.
"""
from dataclasses import dataclass
from pathlib import Path
from typing import Iterator, TextIO

HEAD = "# a session of ISE, version 1 of this file"
HEAD_OF_DATAGRAMS = "# a session of ISE in datagrams, version 1 of this file"
SIDES = ("initiator", "responder")


@dataclass
class Chunk:
    ns: int
    sender: str
    data: bytes | None  # None: this side ended its stream


@dataclass
class Datagram:
    ns: int
    sender: str
    data: bytes
    lost: bool = False  # the relay did not hand it on


def line_of(chunk: Chunk | Datagram) -> str:
    said = "end" if chunk.data is None else chunk.data.hex()
    return f"{chunk.ns} {chunk.sender} {said}{' lost' if isinstance(chunk, Datagram) and chunk.lost else ''}\n"


class Recorder:
    """Writes one session, whole lines only."""

    def __init__(self, into: TextIO, head: str = HEAD):
        self.into = into
        into.write(head + "\n")

    def add(self, chunk: Chunk | Datagram):
        self.into.write(line_of(chunk))


def chunk_of(words: list[str]) -> Chunk:
    ns, sender, data = words
    return Chunk(int(ns), sender, None if data == "end" else bytes.fromhex(data))


def datagram_of(words: list[str]) -> Datagram:
    ns, sender, data, *lost = words
    if lost not in ([], ["lost"]):
        raise ValueError
    return Datagram(int(ns), sender, bytes.fromhex(data), bool(lost))


KINDS = {HEAD: (chunk_of, "<ns> initiator|responder <hex>|end"),
         HEAD_OF_DATAGRAMS: (datagram_of, "<ns> initiator|responder <hex> [lost]")}


def read(file: Path) -> Iterator[Chunk | Datagram]:
    """Throws ValueError that names the line."""
    with open(file, encoding="ascii") as lines:
        if (head := next(lines, "").rstrip("\n")) not in KINDS:
            raise ValueError(f"{file} does not begin with '{HEAD}' or '{HEAD_OF_DATAGRAMS}': it is no recorded session")
        parse, expected = KINDS[head]
        for number, line in enumerate(lines, 2):
            try:
                out = parse(line.split())
                if out.sender not in SIDES:
                    raise ValueError
            except ValueError:
                raise ValueError(f"{file}, line {number}: '{expected}' is expected") from None
            yield out
