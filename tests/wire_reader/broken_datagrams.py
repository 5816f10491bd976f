"""Hand-made sessions in datagrams for the test of the checker: a good one, and one for every rule that a peer can break."""
import struct

from broken_sessions import goodbye, hello, introduce, packet, reply, request, said, subscribe, subscribed, welcome
from frames import MAGIC, encode_frame
from recording import Datagram

INITIATOR, RESPONDER = 11, 22
COOKIE = bytes(range(16))


class Sender:
    """Numbers what one side sends, and keeps the stream."""

    def __init__(self, name: str, to: int):
        self.name, self.to, self.number, self.offset, self.messages = name, to, 0, 0, 0

    def raw(self, data: bytes, lost: bool = False) -> list[Datagram]:
        return [Datagram(0, self.name, data, lost)]

    def data(self, *chunks: bytes, number: int | None = None, to: int | None = None, lost: bool = False) -> list[Datagram]:
        number = self.number if number is None else number
        self.number = number + 1
        return self.raw(encode_frame(9, self.to if to is None else to, struct.pack("<Q", number) + b"".join(chunks)), lost)

    def stream(self, *frames: bytes, lost: bool = False) -> list[Datagram]:
        content = b"".join(frames)
        self.offset += len(content)
        return self.data(chunk(2, struct.pack("<Q", self.offset - len(content)) + content), lost=lost)

    def message(self, data: bytes, only: range | None = None, lost: bool = False) -> list[Datagram]:
        self.messages += 1
        out = []
        for index in only or range(-(-len(data) // 1024)):
            out += self.data(fragment(self.messages - 1, data, index), lost=lost)
        return out


def chunk(kind: int, body: bytes) -> bytes:
    return struct.pack("<BH", kind, len(body)) + body


def word(kind: int, value: int) -> bytes:
    return chunk(kind, struct.pack("<Q", value))


def fragment(number: int, data: bytes, index: int, length: int | None = None) -> bytes:
    piece = data[1024 * index : 1024 * index + 1024]
    return chunk(5, struct.pack("<QII", number, len(data) if length is None else length, index) + piece)


def ack(largest: int, count: int, *pairs: int) -> bytes:
    return chunk(1, struct.pack("<QII", largest, 5, count) + struct.pack(f"<{len(pairs)}I", *pairs))


def opening(cookie: bytes = bytes(16), magic: int = MAGIC, id: int = INITIATOR, size: int = 1200, behind: bytes = b"") -> bytes:
    body = struct.pack("<I", magic) + cookie + behind
    return encode_frame(4, id, body.ljust(size - 16, b"\0"))


def sides() -> tuple[Sender, Sender]:
    return Sender("initiator", RESPONDER), Sender("responder", INITIATOR)


def opened(by: Sender, of: Sender) -> list[Datagram]:
    return (by.raw(opening()) + of.raw(encode_frame(5, INITIATOR, COOKIE)) + by.raw(opening(COOKIE))
            + of.raw(encode_frame(6, INITIATOR, struct.pack("<Q", RESPONDER))))


def greeted(by: Sender, of: Sender) -> list[Datagram]:
    return opened(by, of) + by.stream(hello()) + of.stream(welcome())


def numbered(number: int, id: int = 0, again: bool = False) -> bytes:
    return request(id, flags=6 if again else 2, body=struct.pack("<Q", number) + said("hold"))


def good_datagrams() -> list[Datagram]:
    """Does a bit of everything and breaks nothing; some are lost."""
    i, r = sides()
    out = i.raw(opening(), lost=True) + greeted(i, r) + i.raw(opening(COOKIE)) + r.raw(encode_frame(6, INITIATOR, struct.pack("<Q", RESPONDER)))
    out += i.stream(introduce(), numbered(1), lost=True)
    out += i.data(chunk(6, b"")) + r.data(ack(2, 1, 1, 1))
    start = i.offset - len(introduce() + numbered(1))
    out += i.data(chunk(2, struct.pack("<Q", start) + introduce() + numbered(1)), ack(0, 1))
    out += r.stream(reply())
    out += i.stream(subscribe(), encode_frame(48, 7)) + r.message(packet(4)) + r.stream(subscribed(), encode_frame("pong", 7))
    big = packet(5, body=said("x" * 3000))
    out += r.message(big, lost=True) + r.data(fragment(1, big, 1)) + r.data(fragment(1, big, 0)) + r.data(fragment(1, big, 2))
    out += r.message(packet(7)) + r.message(packet(6))  # late
    out += r.data(word(7, 99)) + i.data(word(8, 99)) + i.data(word(4, 100000)) + r.raw(encode_frame(10, INITIATOR))
    out += i.stream(encode_frame("unsubscribe", 1)) + r.stream(encode_frame("unsubscribed", 1)) + r.message(packet(8))
    out += i.stream(goodbye()) + i.data(word(3, i.offset)) + r.stream(goodbye()) + r.data(word(3, r.offset))
    return out + i.raw(encode_frame(7, RESPONDER)) + r.raw(encode_frame(8, 5)) + r.raw(encode_frame(7, INITIATOR))


def broken(story) -> list[Datagram]:
    i, r = sides()
    return story(i, r)


def after(story):
    """The story behind a handshake."""
    return broken(lambda i, r: greeted(i, r) + story(i, r))


def subscribed_and(story):
    return after(lambda i, r: i.stream(subscribe()) + r.stream(subscribed()) + story(i, r))


LONG = packet(1, body=said("y" * 2000))

BROKEN = {
    "no frame": (broken(lambda i, r: i.raw(b"x" * 15)), "a datagram is one frame"),
    "two frames": (broken(lambda i, r: i.raw(opening(size=600) + opening(size=600))), "a datagram is one frame"),
    "too long": (broken(lambda i, r: i.raw(opening(size=1201))), "at most 1200 bytes, not 1201"),
    "flags": (after(lambda i, r: i.raw(encode_frame(10, RESPONDER, flags=1))), "have no flags"),
    "on after closed": (after(lambda i, r: i.raw(encode_frame(7, RESPONDER)) + i.raw(encode_frame(10, RESPONDER))), "nothing follows closed"),
    "a responder that opens": (broken(lambda i, r: r.raw(opening())), "only the initiator opens"),
    "a short open": (broken(lambda i, r: i.raw(opening(size=100))), "zeros up to 1200 bytes, not 100"),
    "another magic": (broken(lambda i, r: i.raw(opening(magic=5))), "magic is 0x31455349"),
    "no zeros": (broken(lambda i, r: i.raw(opening(behind=b"\1"))), "behind the cookie are zeros"),
    "id 0": (broken(lambda i, r: i.raw(opening(id=0))), "the id is drawn once"),
    "another id": (broken(lambda i, r: i.raw(opening()) + i.raw(opening(id=12))), "the id is drawn once"),
    "a cookie of its own": (broken(lambda i, r: i.raw(opening(COOKIE))), "or one that it was given"),
    "a cookie from the initiator": (broken(lambda i, r: i.raw(encode_frame(5, INITIATOR, COOKIE))), "only the responder answers"),
    "a long cookie": (broken(lambda i, r: i.raw(opening()) + r.raw(encode_frame(5, INITIATOR, COOKIE * 2))), "its body has 16 bytes, not 32"),
    "two cookies": (broken(lambda i, r: i.raw(opening()) + r.raw(encode_frame(5, INITIATOR, COOKIE)) * 2), "answers an open that came, once"),
    "a cookie for what was lost": (broken(lambda i, r: i.raw(opening(), True) + r.raw(encode_frame(5, INITIATOR, COOKIE))), "answers an open that came"),
    "a cookie for another": (broken(lambda i, r: i.raw(opening()) + r.raw(encode_frame(5, 12, COOKIE))), "its id is that of the open"),
    "no cookie first": (broken(lambda i, r: i.raw(opening()) + r.raw(encode_frame(6, INITIATOR, bytes([22]) + bytes(7)))), "a cookie first"),
    "a responder with id 0": (broken(lambda i, r: opened(i, r)[:3] + r.raw(encode_frame(6, INITIATOR, bytes(8)))), "the id is drawn once"),
    "a body in closed": (after(lambda i, r: i.raw(encode_frame(7, RESPONDER, b"x"))), "it is empty"),
    "a sign for another": (after(lambda i, r: i.raw(encode_frame(10, 5))), "its id is the receiver's"),
    "data for another": (after(lambda i, r: i.data(to=5)), "its id is the receiver's"),
    "data before it is open": (broken(lambda i, r: i.raw(opening()) + i.data(to=0)), "its id is the receiver's"),
    "no number": (after(lambda i, r: i.raw(encode_frame(9, RESPONDER, b"x"))), "data has a number"),
    "a number left out": (after(lambda i, r: i.data(number=2)), "1 is the next, not 2"),
    "a number twice": (after(lambda i, r: i.data(number=0)), "1 is the next, not 0"),
    "a chunk too long": (after(lambda i, r: i.data(struct.pack("<BH", 2, 9))), "reaches beyond its datagram"),
    "half a chunk": (after(lambda i, r: i.data(b"\2")), "reaches beyond its datagram"),
    "a short ack": (after(lambda i, r: i.data(chunk(1, b"x" * 15))), "ack has not 15 bytes"),
    "a probe with content": (after(lambda i, r: i.data(chunk(6, b"x"))), "probe has not 1 bytes"),
    "half a pair": (after(lambda i, r: i.data(ack(0, 1, 1))), "ends in pairs"),
    "an ack of what was not sent": (after(lambda i, r: i.data(ack(1, 1))), "1 came down from 1, and they did not"),
    "an ack of what was lost": (after(lambda i, r: r.data(lost=True) + i.data(ack(1, 2))), "2 came down from 1"),
    "an ack below 0": (after(lambda i, r: i.data(ack(0, 2))), "2 came down from 0"),
    "an ack of nothing": (after(lambda i, r: i.data(ack(0, 0))), "0 came down from 0"),
    "no room": (after(lambda i, r: i.data(chunk(2, struct.pack("<Q", 32768) + b"x"))), "reaches 32769 where there is room up to 32768"),
    "room that was lost": (after(lambda i, r: r.data(word(4, 40000), lost=True) + i.data(chunk(2, struct.pack("<Q", 32768) + b"x"))), "room up to 32768"),
    "content behind the end": (after(lambda i, r: i.data(word(3, i.offset)) + i.stream(b"x")), "behind its end"),
    "another content": (after(lambda i, r: i.data(chunk(2, bytes(8) + b"xx"))), "the stream at 0 was another before"),
    "an end before what was sent": (after(lambda i, r: i.data(word(3, 1))), "the stream ends at 1"),
    "two ends": (after(lambda i, r: i.data(word(3, 9000)) + i.data(word(3, 9001))), "the stream ends at 9001"),
    "a message too long": (after(lambda i, r: r.data(fragment(0, bytes(1024), 0, 1048593))), "at most 1 MiB, not 1048593"),
    "messages that do not count": (after(lambda i, r: r.data(fragment(1, LONG, 0))), "0 is the next, not 1"),
    "a fragment behind the last": (after(lambda i, r: r.data(fragment(0, LONG, 2))), "has its place"),
    "a short fragment": (after(lambda i, r: r.data(fragment(0, LONG[:500], 0, 2000))), "has its place"),
    "another length": (after(lambda i, r: r.data(fragment(0, LONG, 0)) + r.data(fragment(0, LONG + b"z", 0))), "has its place"),
    "a fragment of other bytes": (after(lambda i, r: r.data(fragment(0, LONG, 0)) + r.data(fragment(0, b"z" * len(LONG), 0))), "never another content"),
    "an old packet again": (subscribed_and(lambda i, r: r.message(packet(1), lost=True) + r.message(packet(2)) + r.data(fragment(0, packet(1), 0))),
                            "message 0 is sent again, and 1 of its subscription is newer"),
    "a ping as a message": (after(lambda i, r: r.message(encode_frame("ping"))), "a message is one packet frame"),
    "a packet in the stream": (subscribed_and(lambda i, r: r.stream(packet(1))), "a packet is a message beside the stream"),
    "a response to nothing": (after(lambda i, r: i.data(word(8, 5))), "a response answers a challenge"),
    "a number of a call twice": (after(lambda i, r: i.stream(introduce(), numbered(1), numbered(1, 1))), "the number 1 was used in this session"),
    "again without a number": (after(lambda i, r: i.stream(introduce(), request(flags=4))), "only what is numbered comes again"),
}

NOTED = {
    "an unknown datagram": (after(lambda i, r: i.raw(encode_frame(15, RESPONDER))), "no datagram of version 1"),
    "an unknown chunk": (after(lambda i, r: i.data(chunk(9, b"later"))), "chunk 9 is not of version 1"),
}
