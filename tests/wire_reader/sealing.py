"""FORMAT.md §17 and §18: an initiator of TLS 1.3 with the shared key, and the datagrams that its exporter's keys seal."""
import asyncio
import hashlib
import hmac
import os
import struct
from typing import Callable, Iterator

from frames import HEADER, MAGIC, encode_frame

TAG = 16
HANDSHAKE, ALERT, DATA = 22, 21, 23  # types of records
DATAGRAM = 1200
FLIGHT, SEALED, SIGN = 13, 14, 15
PART = DATAGRAM - HEADER.size - 3


def _aes_box() -> bytes:
    def double(x: int) -> int:
        return (x << 1) ^ (0x11B if x & 0x80 else 0)

    power, logarithm, x = [0] * 255, [0] * 256, 1
    for i in range(255):  # powers of 3
        power[i], logarithm[x] = x, i
        x ^= double(x)
    box = [0x63] * 256
    for value in range(1, 256):
        inverse = power[-logarithm[value] % 255]
        for shift in range(5):
            box[value] ^= (inverse << shift | inverse >> 8 - shift) & 0xFF
    return bytes(box)


BOX = _aes_box()


class AesGcm:
    """AES-128-GCM with nonces of 12 bytes. Slow, and only for tests."""

    def __init__(self, key: bytes):
        words, round_constant = [key[i : i + 4] for i in range(0, 16, 4)], 1
        while len(words) < 44:
            last = words[-1]
            if len(words) % 4 == 0:
                last = bytes(BOX[each] for each in last[1:] + last[:1])
                last = bytes([last[0] ^ round_constant]) + last[1:]
                round_constant = round_constant << 1 ^ (0x11B if round_constant & 0x80 else 0)
            words.append(bytes(a ^ b for a, b in zip(words[-4], last)))
        self.rounds = [b"".join(words[i : i + 4]) for i in range(0, 44, 4)]
        self.hash_key = int.from_bytes(self.block(bytes(16)), "big")

    def block(self, data: bytes) -> bytes:
        state = [a ^ b for a, b in zip(data, self.rounds[0])]
        for number, key in enumerate(self.rounds[1:], 1):
            state = [BOX[state[(i + 4 * (i % 4)) % 16]] for i in range(16)]
            if number < 10:
                mixed = []
                for at in range(0, 16, 4):
                    column = state[at : at + 4]
                    every = column[0] ^ column[1] ^ column[2] ^ column[3]
                    for i in range(4):
                        pair = column[i] ^ column[(i + 1) % 4]
                        mixed.append(column[i] ^ every ^ (pair << 1 ^ (0x11B if pair & 0x80 else 0)))
                state = mixed
            state = [a ^ b for a, b in zip(state, key)]
        return bytes(state)

    def multiplied(self, x: int) -> int:
        product, by = 0, self.hash_key
        for bit in range(127, -1, -1):
            if x >> bit & 1:
                product ^= by
            by = by >> 1 ^ (0xE1 << 120 if by & 1 else 0)
        return product

    def tag(self, nonce: bytes, head: bytes, sealed: bytes) -> bytes:
        digest = 0
        for part in (head, sealed, struct.pack(">QQ", 8 * len(head), 8 * len(sealed))):
            for at in range(0, len(part), 16):
                digest = self.multiplied(digest ^ int.from_bytes(part[at : at + 16].ljust(16, b"\0"), "big"))
        mask = self.block(nonce + struct.pack(">I", 1))
        return bytes(a ^ b for a, b in zip(digest.to_bytes(16, "big"), mask))

    def crypt(self, nonce: bytes, data: bytes) -> bytes:
        stream = b"".join(self.block(nonce + struct.pack(">I", 2 + at)) for at in range(-(-len(data) // 16)))
        return bytes(a ^ b for a, b in zip(data, stream))

    def seal(self, nonce: bytes, head: bytes, data: bytes) -> tuple[bytes, bytes]:
        sealed = self.crypt(nonce, data)
        return sealed, self.tag(nonce, head, sealed)

    def open(self, nonce: bytes, head: bytes, sealed: bytes, tag: bytes) -> bytes:
        if not hmac.compare_digest(tag, self.tag(nonce, head, sealed)):
            raise ConnectionError("what came is not sealed with the keys of this session")
        return self.crypt(nonce, sealed)


def x25519(scalar: bytes, point: bytes = b"\x09".ljust(32, b"\0")) -> bytes:
    prime = 2**255 - 19
    factor = int.from_bytes(scalar, "little") & ~7 & ~(1 << 255) | 1 << 254
    x1 = int.from_bytes(point, "little") & (1 << 255) - 1
    x2, z2, x3, z3 = 1, 0, x1, 1
    for bit in range(254, -1, -1):
        swap = factor >> bit & 1
        if swap:
            x2, x3, z2, z3 = x3, x2, z3, z2
        a, b, c, d = x2 + z2, x2 - z2, x3 + z3, x3 - z3
        da, cb = d * a, c * b
        x3, z3 = pow(da + cb, 2, prime), x1 * pow(da - cb, 2, prime) % prime
        aa, bb = a * a % prime, b * b % prime
        x2, z2 = aa * bb % prime, (aa - bb) * (aa + 121665 * (aa - bb)) % prime
        if swap:
            x2, x3, z2, z3 = x3, x2, z3, z2
    return (x2 * pow(z2, prime - 2, prime) % prime).to_bytes(32, "little")


def digest(data: bytes) -> bytes:
    return hashlib.sha256(data).digest()


def mac(key: bytes, data: bytes) -> bytes:
    return hmac.new(key, data, hashlib.sha256).digest()


def expand(secret: bytes, info: bytes, size: int) -> bytes:
    out, last = b"", b""
    for number in range(1, -(-size // 32) + 1):
        last = mac(secret, last + info + bytes([number]))
        out += last
    return out[:size]


def expand_label(secret: bytes, label: str, context: bytes, size: int) -> bytes:
    name = b"tls13 " + label.encode()
    return expand(secret, struct.pack(">HB", size, len(name)) + name + bytes([len(context)]) + context, size)


def derive(secret: bytes, label: str, said: bytes) -> bytes:
    return expand_label(secret, label, digest(said), 32)


def numbered(iv: bytes, number: int) -> bytes:
    return bytes(a ^ b for a, b in zip(iv, number.to_bytes(12, "big")))


class Records:
    """One direction of records that are encrypted by a traffic secret."""

    def __init__(self, secret: bytes):
        self.aead, self.iv, self.number = AesGcm(expand_label(secret, "key", b"", 16)), expand_label(secret, "iv", b"", 12), 0

    def made(self, type: int, data: bytes) -> bytes:
        head = struct.pack(">BHH", DATA, 0x303, len(data) + 1 + TAG)
        sealed, tag = self.aead.seal(self.next(), head, data + bytes([type]))
        return head + sealed + tag

    def opened(self, record: bytes) -> tuple[int, bytes]:
        data = self.aead.open(self.next(), record[:5], record[5:-TAG], record[-TAG:]).rstrip(b"\0")
        return data[-1], data[:-1]

    def next(self) -> bytes:
        self.number += 1
        return numbered(self.iv, self.number - 1)


def records(data: bytes) -> Iterator[bytes]:
    """The whole ones at its begin."""
    while len(data) >= 5 and len(data) >= (size := 5 + int.from_bytes(data[3:5], "big")):
        yield data[:size]
        data = data[size:]


def vector(form: str, data: bytes) -> bytes:
    return struct.pack(form, len(data)) + data


class Initiator:
    """The client of TLS 1.3 with the key as an external PSK: says `hello`, and `answer`s the flight of the other side."""

    def __init__(self, key: bytes):
        self.psk = mac(key, b"ISE1 sealed\0")
        self.scalar = os.urandom(32)
        self.early = mac(bytes(32), self.psk)
        extensions = b"".join(struct.pack(">H", type) + vector(">H", body) for type, body in (
            (43, b"\x02\x03\x04"), (10, b"\x00\x02\x00\x1d"), (45, b"\x01\x01"),
            (51, vector(">H", b"\x00\x1d" + vector(">H", x25519(self.scalar))))))
        identities = vector(">H", vector(">H", b"ISE1") + bytes(4))
        binders = 2 + 1 + 32
        extensions += struct.pack(">HH", 41, len(identities) + binders) + identities
        body = b"\x03\x03" + os.urandom(32) + b"\0" + b"\x00\x02\x13\x01" + b"\x01\x00"
        body += struct.pack(">H", len(extensions) + binders) + extensions
        begin = b"\x01" + (len(body) + binders).to_bytes(3, "big") + body
        binder_key = derive(self.early, "ext binder", b"")
        binder = mac(expand_label(binder_key, "finished", b"", 32), digest(begin))
        self.said = begin + vector(">H", vector(">B", binder))
        self.hello = struct.pack(">BHH", HANDSHAKE, 0x301, len(self.said)) + self.said

    def answer(self, flight: bytes) -> bytes | None:
        """The last flight; nothing: some of the other one is missing yet. Raises ConnectionError where it proves nothing."""
        server, rest = b"", b""
        reader = None
        said = self.said
        for record in records(flight):
            type, data = record[0], record[5:]
            if type == ALERT:
                raise ConnectionError(f"the peer ended TLS by alert {data[1]}")
            if not reader and type == HANDSHAKE:
                said += data
                reader = self.on_hello(data, said)
                continue
            type, data = reader.opened(record)
            if type != HANDSHAKE:
                raise ConnectionError(f"a record of type {type} within the handshake")
            rest += data
            while len(rest) >= 4 and len(rest) >= (size := 4 + int.from_bytes(rest[1:4], "big")):
                server, rest = rest[:size], rest[size:]
                if server[0] == 20:
                    return self.finish(server[4:], said, said + server)
                if server[0] != 8:
                    raise ConnectionError(f"the peer sent {server[0]} in a handshake without certificates")
                said += server
        return None

    def on_hello(self, data: bytes, said: bytes) -> Records:
        if data[0] != 2 or data[4 + 2 + 32] != 0:
            raise ConnectionError("no ServerHello came")
        at = 4 + 2 + 32 + 1
        suite, at = data[at : at + 2], at + 3 + 2
        extensions = {}
        while at < len(data):
            type, size = struct.unpack_from(">HH", data, at)
            extensions[type] = data[at + 4 : at + 4 + size]
            at += 4 + size
        if suite != b"\x13\x01" or extensions.get(43) != b"\x03\x04" or extensions.get(41) != b"\x00\x00" or 51 not in extensions:
            raise ConnectionError("the peer did not select TLS 1.3 with the shared key and a key exchange")
        shared = x25519(self.scalar, extensions[51][4:])
        secret = mac(derive(self.early, "derived", b""), shared)
        self.theirs, self.own = derive(secret, "s hs traffic", said), derive(secret, "c hs traffic", said)
        self.master = mac(derive(secret, "derived", b""), bytes(32))
        return Records(self.theirs)

    def finish(self, proof: bytes, before: bytes, said: bytes) -> bytes:
        if not hmac.compare_digest(proof, mac(expand_label(self.theirs, "finished", b"", 32), digest(before))):
            raise ConnectionError("the peer does not know the key")
        self.outgoing, self.incoming = (Records(derive(self.master, f"{side} ap traffic", said)) for side in "cs")
        exporter = derive(derive(self.master, "exp master", said), "EXPORTER-ISE1-datagrams", b"")
        self.exported = expand_label(exporter, "exporter", digest(b""), 64)
        own = mac(expand_label(self.own, "finished", b"", 32), digest(said))
        return Records(self.own).made(HANDSHAKE, b"\x14" + len(own).to_bytes(3, "big") + own)


class Sealed:
    """What both kinds have for whoever reads and writes a stream."""

    async def wait_closed(self):
        return


class SealedStream(Sealed):
    """§17: a stream inside TLS over another one."""

    @classmethod
    async def over(cls, reader: asyncio.StreamReader, writer: asyncio.StreamWriter, key: bytes) -> "SealedStream":
        self, initiator, came = cls(), Initiator(key), b""
        self.reader, self.writer = reader, writer
        writer.write(initiator.hello)
        while not (last := initiator.answer(came)):
            data = await reader.read(65536)
            if not data:
                raise ConnectionError("the peer left during the handshake")
            came += data
        writer.write(last)
        self.tls, self.rest = initiator, b""
        return self

    async def read(self, _: int) -> bytes:
        while True:
            for record in records(self.rest):
                self.rest = self.rest[len(record) :]
                type, data = self.tls.incoming.opened(record)
                if type == DATA and data:
                    return data
                if type == ALERT:
                    return b""
            data = await self.reader.read(65536)
            if not data:
                raise ConnectionError("cut off, without close_notify")
            self.rest += data

    def write(self, data: bytes):
        for at in range(0, len(data), 16384):
            self.writer.write(self.tls.outgoing.made(DATA, data[at : at + 16384]))

    def close(self):
        self.writer.write(self.tls.outgoing.made(ALERT, b"\x01\x00"))
        self.writer.close()


class Direction:
    """§18: the keys of a direction."""

    def __init__(self, secret: bytes):
        self.secret = secret
        self.aead, self.iv = AesGcm(expand(secret, b"ISE1 key", 32)[:16]), expand(secret, b"ISE1 iv", 32)[:12]

    def next(self) -> "Direction":
        return Direction(expand(self.secret, b"ISE1 next", 32))

    def made(self, to: int, number: int, chunks: bytes, phase: int = 0) -> bytes:
        head = HEADER.pack(8 + TAG + len(chunks), SEALED, phase, 0, to) + struct.pack("<Q", number)
        sealed, tag = self.aead.seal(numbered(self.iv, number), head, chunks)
        return head + tag + sealed

    def opened(self, datagram: bytes) -> tuple[int, bytes]:
        head, number = datagram[:24], int.from_bytes(datagram[16:24], "little")
        return number, self.aead.open(numbered(self.iv, number), head, datagram[40:], datagram[24:40])


class SealedChannel(Sealed, asyncio.DatagramProtocol):
    """§13 and §18: the stream of a sealed channel. It sends nothing again: for a network that loses nothing."""

    @classmethod
    async def to(cls, host: str, port: int, key: bytes) -> "SealedChannel":
        loop = asyncio.get_running_loop()
        _, self = await loop.create_datagram_endpoint(cls, remote_addr=(host, port))
        self.id = int.from_bytes(os.urandom(8), "little") | 1
        self.tls = Initiator(key)
        await self.opened(bytes(16))
        try:
            await asyncio.wait_for(self.shaken, 20)
        except BaseException:
            self.transport.close()
            raise
        return self

    def __init__(self):
        self.shaken = asyncio.get_running_loop().create_future()
        self.peer, self.parts, self.flight = 0, {}, b""
        self.number = self.offset = self.taken = self.phase = 0
        self.came: set[int] = set()
        self.content: dict[int, bytes] = {}
        self.ready = asyncio.Event()
        self.over = False
        self.plain = 0  # datagrams of data that were not sealed

    def connection_made(self, transport):
        self.transport = transport

    async def opened(self, cookie: bytes):
        body = struct.pack("<I", MAGIC) + cookie
        self.transport.sendto(encode_frame(4, self.id, body.ljust(DATAGRAM - HEADER.size, b"\0")))

    def say(self, number: int, flight: bytes):
        parts = [flight[at : at + PART] for at in range(0, len(flight), PART)]
        for part, each in enumerate(parts):
            self.transport.sendto(encode_frame(FLIGHT, self.peer, bytes([number, part, len(parts)]) + each))

    def datagram_received(self, data: bytes, _):
        _, type, flags, _, id = HEADER.unpack_from(data)
        if id != self.id:
            return
        body = data[HEADER.size :]
        if type == 5:
            asyncio.ensure_future(self.opened(body[:16]))
        elif type == 6 and not self.peer:
            self.peer = int.from_bytes(body, "little")
            self.say(1, self.tls.hello)
        elif type == FLIGHT and body[0] == 2 and not self.shaken.done():
            self.parts[body[1]] = body[3:]
            if len(self.parts) == body[2]:
                self.on_flight(b"".join(self.parts[part] for part in sorted(self.parts)))
        elif type == SEALED and self.shaken.done():
            self.on_data(data, flags)
        elif type == 9:
            self.plain += 1

    def on_flight(self, flight: bytes):
        try:
            last = self.tls.answer(flight)
            if not last:
                raise ConnectionError("a flight ends before the handshake")
        except ConnectionError as why:
            self.shaken.set_exception(why)
            return
        self.outgoing, self.incoming = Direction(self.tls.exported[:32]), Direction(self.tls.exported[32:])
        self.say(3, last)
        self.shaken.set_result(None)

    def on_data(self, data: bytes, phase: int):
        if phase != self.phase:  # this side sends too little for datagrams of former keys to matter
            self.incoming, self.phase = self.incoming.next(), phase
        number, chunks = self.incoming.opened(data)
        if number in self.came:
            return
        self.came.add(number)
        wants_ack = False
        while chunks:
            kind, size = struct.unpack_from("<BH", chunks)
            content, chunks = chunks[3 : 3 + size], chunks[3 + size :]
            wants_ack |= kind not in (1, 4)
            if kind == 2:
                offset = int.from_bytes(content[:8], "little")
                if offset >= self.taken:
                    self.content[offset] = content[8:]
                self.ready.set()
            elif kind in (3, 9):
                self.over = True
                self.ready.set()
        if wants_ack:
            first = max(each for each in self.came)
            run = next(count for count in range(1, len(self.came) + 2) if first - count not in self.came)
            self.send(struct.pack("<BHQII", 1, 16, first, 0, run) + struct.pack("<BHQ", 4, 8, self.taken + (1 << 20)))

    def send(self, chunks: bytes):
        self.transport.sendto(self.outgoing.made(self.peer, self.number, chunks))
        self.number += 1

    async def read(self, _: int) -> bytes:
        while True:
            if self.taken in self.content:
                data = self.content.pop(self.taken)
                self.taken += len(data)
                return data
            if self.over:
                return b""
            self.ready.clear()
            await asyncio.wait_for(self.ready.wait(), 30)

    def write(self, data: bytes):
        for at in range(0, len(data), 1024):
            part = data[at : at + 1024]
            self.send(struct.pack("<BHQ", 2, 8 + len(part), self.offset) + part)
            self.offset += len(part)

    def close(self):
        self.send(struct.pack("<BHQ", 3, 8, self.offset) + struct.pack("<BH", 9, 0))
        self.transport.close()


async def dial_sealed(to: str, key: bytes, dial: Callable) -> tuple:
    """A reader and a writer of the stream to `to`."""
    if to.startswith("udp://"):
        host, _, port = to.removeprefix("udp://").rpartition(":")
        made = await SealedChannel.to(host, int(port), key)
    else:
        made = await SealedStream.over(*await dial(to), key)
    return made, made
