"""FORMAT.md §13: datagrams, and the stream and the messages that lie in them."""
import struct
from dataclasses import dataclass, field

from frames import DATAGRAMS, HEADER, MAGIC, NUMBERS, Envelope, Frame
from recording import Datagram

LONGEST = 1200
LONGEST_BODY = 1 << 20
FRAGMENT = 1024
CHUNK = struct.Struct("<BH")
FRAGMENT_HEAD = struct.Struct("<QII")
ROOM_AT_FIRST = 32768
KINDS = {1: "ack", 2: "content", 3: "end", 4: "room", 5: "fragment", 6: "probe", 7: "challenge", 8: "response"}
EXACTLY = {"end": 8, "room": 8, "probe": 0, "challenge": 8, "response": 8}
AT_LEAST = {"ack": 16, "content": 8, "fragment": FRAGMENT_HEAD.size}


@dataclass
class Message:
    """A packet frame that comes in fragments."""

    length: int
    sent: dict[int, bytes] = field(default_factory=dict)
    came: set[int] = field(default_factory=set)
    number_in: int = 0  # of the datagram that had its first fragment

    @property
    def subscription(self) -> int | None:
        return struct.unpack_from("<Q", self.sent[0], 8)[0] if len(self.sent.get(0, b"")) >= HEADER.size else None

    @property
    def fragments(self) -> int:
        return -(-self.length // FRAGMENT)


@dataclass
class Channel:
    """What one side has sent, and what of it was handed on."""

    id: int = 0
    bytes: int = 0  # of all its datagrams
    numbers: int = 0
    came: set[int] = field(default_factory=set)  # numbers that were handed on
    closed: bool = False
    stream: bytearray = field(default_factory=bytearray)  # as sent
    known: bytearray = field(default_factory=bytearray)  # 1 where a byte of it was sent
    taken: int = 0  # bytes of it that came without a gap
    waiting: dict[int, bytes] = field(default_factory=dict)  # what came beyond a gap, by offset
    end: int | None = None
    room: int = ROOM_AT_FIRST  # that this side granted to the other
    messages: list[Message] = field(default_factory=list)
    newest: dict[int, int] = field(default_factory=dict)  # the number of the newest message of each subscription
    early: list[Frame] = field(default_factory=list)  # packets before the answer to their subscribe
    challenges: set[bytes] = field(default_factory=set)  # that it was asked
    cookies: list[bytes] = field(default_factory=list)  # of a responder


class DatagramRules:
    def __init__(self, checker):
        self.on = checker
        self.channels = {name: Channel() for name in checker.sides}
        self.opens = 0  # that came and were not answered

    def take(self, side, datagram: Datagram):
        mine, data = self.channels[side.name], datagram.data
        head = HEADER.unpack_from(data.ljust(HEADER.size, b"\0"))
        frame = Envelope(mine.bytes, *head[1:], data[HEADER.size :])
        mine.bytes += len(data)
        whole = len(data) >= HEADER.size and head[0] == len(data) - HEADER.size
        if not self.on.require(whole, side, frame, f"a datagram is one frame, and its length is the rest: {head[0]}"):
            return
        self.on.require(len(data) <= LONGEST, side, frame, f"a datagram has at most {LONGEST} bytes, not {len(data)}")
        self.on.require(not frame.flags and not frame.reserved, side, frame, "datagrams have no flags")
        self.on.require(not mine.closed or frame.name == "unknown", side, frame, "nothing follows closed")
        if self.on.note(frame.type in DATAGRAMS, side, frame, "no datagram of version 1; it is passed over"):
            getattr(self, "on_" + frame.name)(side, mine, frame, not datagram.lost)

    # Opening.

    def on_open(self, side, mine: Channel, frame: Frame, came: bool):
        self.on.require(side.name == "initiator", side, frame, "only the initiator opens")
        size = HEADER.size + len(frame.body)
        if not self.on.require(size == LONGEST, side, frame, f"an open has zeros up to {LONGEST} bytes, not {size}"):
            return
        magic, cookie = struct.unpack_from("<I16s", frame.body)
        self.on.require(magic == MAGIC, side, frame, f"magic is {MAGIC:#x}, not {magic:#x}")
        self.on.require(not any(frame.body[20:]), side, frame, "behind the cookie are zeros")
        self.on.require(frame.id != 0 and mine.id in (0, frame.id), side, frame, "the id is drawn once and is not 0")
        known = not any(cookie) or cookie in self.channels["responder"].cookies
        self.on.require(known, side, frame, "its cookie is zero, or one that it was given")
        mine.id = frame.id
        self.opens += came

    def answers_open(self, side, frame: Frame, size: int) -> bool:
        ok = self.on.require(side.name == "responder", side, frame, "only the responder answers an open")
        ok &= self.on.require(len(frame.body) == size, side, frame, f"its body has {size} bytes, not {len(frame.body)}")
        ok &= self.on.require(self.opens > 0, side, frame, "it answers an open that came, once")
        self.opens = max(self.opens - 1, 0)
        self.on.require(frame.id == self.channels["initiator"].id, side, frame, "its id is that of the open")
        return ok

    def on_cookie(self, side, mine: Channel, frame: Frame, came: bool):
        if self.answers_open(side, frame, 16) and came:
            mine.cookies.append(frame.body)

    def on_opened(self, side, mine: Channel, frame: Frame, came: bool):
        if self.answers_open(side, frame, 8):
            id = struct.unpack("<Q", frame.body)[0]
            self.on.require(bool(mine.cookies), side, frame, "a stranger is sent a cookie first")
            self.on.require(id != 0 and mine.id in (0, id), side, frame, "the id is drawn once and is not 0")
            mine.id = id

    # The end.

    def empty(self, side, frame: Frame):
        self.on.require(not frame.body, side, frame, "it is empty")
        if frame.name != "unknown":  # whose id is one that nobody has
            self.on.require(frame.id == self.channels[self.on.peer(side).name].id, side, frame, "its id is the receiver's")

    def on_closed(self, side, mine: Channel, frame: Frame, came: bool):
        self.empty(side, frame)
        mine.closed = True

    def on_unknown(self, side, mine: Channel, frame: Frame, came: bool):
        self.empty(side, frame)

    def on_sign(self, side, mine: Channel, frame: Frame, came: bool):
        self.empty(side, frame)

    # Data.

    def on_data(self, side, mine: Channel, frame: Frame, came: bool):
        other = self.channels[self.on.peer(side).name]
        self.on.require(frame.id == other.id != 0, side, frame, "its id is the receiver's")
        if not self.on.require(len(frame.body) >= 8, side, frame, "data has a number"):
            return
        number = struct.unpack_from("<Q", frame.body)[0]
        self.on.require(number == mine.numbers, side, frame, f"datagrams count: {mine.numbers} is the next, not {number}")
        mine.numbers = number + 1
        if came:
            mine.came.add(number)
        at = 8
        while at < len(frame.body):
            if at + CHUNK.size > len(frame.body):
                kind, size = 0, LONGEST
            else:
                kind, size = CHUNK.unpack_from(frame.body, at)
            at += CHUNK.size
            if not self.on.require(at + size <= len(frame.body), side, frame, "a chunk reaches beyond its datagram"):
                return
            self.chunk(side, mine, frame, KINDS.get(kind, f"chunk {kind}"), frame.body[at : at + size], came)
            at += size

    def chunk(self, side, mine: Channel, frame: Frame, kind: str, body: bytes, came: bool):
        fits = len(body) == EXACTLY.get(kind, len(body)) and len(body) >= AT_LEAST.get(kind, 0)
        if not self.on.require(fits, side, frame, f"{kind} has not {len(body)} bytes"):
            return
        if self.on.note(kind in KINDS.values(), side, frame, f"{kind} is not of version 1; it is passed over"):
            getattr(self, "chunk_" + kind)(side, mine, frame, body, came)

    def chunk_ack(self, side, mine: Channel, frame: Frame, body: bytes, came: bool):
        other = self.channels[self.on.peer(side).name]
        largest, _, count = struct.unpack_from("<QII", body)
        pairs = body[16:]
        if not self.on.require(len(pairs) % 8 == 0, side, frame, f"an ack ends in pairs, not in {len(pairs)} bytes"):
            return
        ranges, at = [(largest, count)], largest - count
        for missing, more in struct.iter_unpack("<II", pairs):
            ranges.append((at - missing, more))
            at -= missing + more
        for top, count in ranges:
            held = count > 0 and all(number in other.came for number in range(max(top - count + 1, -1), top + 1))
            self.on.require(held, side, frame, f"it says that {count} came down from {top}, and they did not")

    def chunk_content(self, side, mine: Channel, frame: Frame, body: bytes, came: bool):
        offset, data = struct.unpack_from("<Q", body)[0], body[8:]
        end = offset + len(data)
        room = self.channels[self.on.peer(side).name].room
        if not self.on.require(end <= room, side, frame, f"the stream reaches {end} where there is room up to {room}"):
            return
        self.on.require(mine.end is None or end <= mine.end, side, frame, f"the stream reaches {end} behind its end at {mine.end}")
        grow = end - len(mine.stream)
        mine.stream += bytes(max(grow, 0))
        mine.known += bytes(max(grow, 0))
        same = all(not mine.known[offset + i] or mine.stream[offset + i] == byte for i, byte in enumerate(data))
        self.on.require(same, side, frame, f"the stream at {offset} was another before")
        mine.stream[offset:end], mine.known[offset:end] = data, b"\1" * len(data)
        if came:
            mine.waiting[offset] = max(data, mine.waiting.get(offset, b""), key=len)
            self.advance(side, mine)

    def advance(self, side, mine: Channel):
        while ready := [offset for offset in mine.waiting if offset <= mine.taken]:
            for offset in ready:
                data = mine.waiting.pop(offset)[mine.taken - offset :]
                mine.taken += len(data)
                if data:
                    self.on.stream(side, data)
        for each in self.channels.values():  # an answer came: what was early counts now
            waiting, each.early = each.early, []
            for frame in waiting:
                self.packet(self.on.sides["initiator" if each is self.channels["initiator"] else "responder"], each, frame)

    def chunk_end(self, side, mine: Channel, frame: Frame, body: bytes, came: bool):
        end = struct.unpack("<Q", body)[0]
        ok = end >= len(mine.stream) and mine.end in (None, end)
        self.on.require(ok, side, frame, f"the stream ends at {end}, where it reached {len(mine.stream)} or ended at {mine.end}")
        mine.end = end

    def chunk_room(self, side, mine: Channel, frame: Frame, body: bytes, came: bool):
        if came:
            mine.room = max(mine.room, struct.unpack("<Q", body)[0])

    def chunk_fragment(self, side, mine: Channel, frame: Frame, body: bytes, came: bool):
        number, length, index = FRAGMENT_HEAD.unpack_from(body)
        data = body[FRAGMENT_HEAD.size :]
        self.on.require(length <= HEADER.size + LONGEST_BODY, side, frame, f"a message has at most 1 MiB, not {length}")
        if number == len(mine.messages):
            mine.messages.append(Message(length, number_in=mine.numbers))
        if not self.on.require(number < len(mine.messages), side, frame, f"messages count: {len(mine.messages)} is the next, not {number}"):
            return
        message = mine.messages[number]
        size = min(FRAGMENT, message.length - FRAGMENT * index)
        fits = length == message.length and len(data) == size
        fits &= message.sent.get(index, data) == data
        if not self.on.require(fits, side, frame, f"fragment {index} of message {number} has its place, and never another content"):
            return
        of = message.subscription
        stale = index in message.sent and mine.newest.get(of, number) > number and mine.messages[mine.newest[of]].number_in < mine.numbers
        self.on.require(not stale, side, frame, f"message {number} is sent again, and {mine.newest.get(of)} of its subscription is newer")
        message.sent[index] = data
        if (of := message.subscription) is not None:
            mine.newest[of] = max(number, mine.newest.get(of, 0))
        if came and index not in message.came:
            message.came.add(index)
            if len(message.came) == message.fragments:
                self.complete(side, mine, frame, b"".join(message.sent[n] for n in range(message.fragments)))

    def complete(self, side, mine: Channel, frame: Frame, data: bytes):
        head = HEADER.unpack_from(data.ljust(HEADER.size, b"\0"))
        packet = head[1] == NUMBERS["packet"] and head[0] == len(data) - HEADER.size
        if self.on.require(packet, side, frame, "a message is one packet frame, and no other"):
            self.packet(side, mine, Frame(frame.offset, *head[1:], data[HEADER.size :], alone=True))

    def packet(self, side, mine: Channel, frame: Frame):
        ready = self.on.subscriptions.ready_for(side, frame)
        if ready is None:
            mine.early.append(frame)
        elif ready:
            self.on.message(side, frame)

    def chunk_probe(self, side, mine: Channel, frame: Frame, body: bytes, came: bool):
        pass

    def chunk_challenge(self, side, mine: Channel, frame: Frame, body: bytes, came: bool):
        if came:
            self.channels[self.on.peer(side).name].challenges.add(body)

    def chunk_response(self, side, mine: Channel, frame: Frame, body: bytes, came: bool):
        self.on.require(body in mine.challenges, side, frame, "a response answers a challenge that came")
