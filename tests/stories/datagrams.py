"""An initiator over datagrams (ise/wire/FORMAT.md §13) that says what it likes in its hello and numbers its calls itself."""
import os
import socket
import struct
import sys
import time
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "wire_reader"))
from frames import DATAGRAMS, HEADER, MAGIC, REQUEST, FrameReader, control, encode_frame  # noqa: E402
from schema import fingerprint, parse  # noqa: E402

KIND = {name: number for number, name in DATAGRAMS.items()}
ACK, CONTENT = 1, 2
NUMBERED, AGAIN = 2, 4  # flags of a request
PART = 1100  # bytes of the stream in a datagram


class Peer:
    def __init__(self, to: tuple[str, int], hello: dict):
        self.socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self.socket.connect(to)
        self.own, self.theirs = int.from_bytes(os.urandom(8), "little"), 0
        self.number, self.offset, self.acked = 0, 0, -1
        self.came: set[int] = set()
        self.parts: dict[int, bytes] = {}
        self.taken = 0
        self.reader, self.frames = FrameReader(), []
        cookie = bytes(16)
        for word in ("cookie", "opened"):
            self.datagram("open", self.own, (struct.pack("<I", MAGIC) + cookie).ljust(1200 - HEADER.size, b"\0"))
            cookie = self.wait(word)
        self.theirs = struct.unpack("<Q", cookie)[0]
        self.say(control("hello", **hello))
        if not self.until(lambda: any(frame.name == "welcome" for frame in self.frames)):
            raise ConnectionError(f"no welcome: {[frame.name for frame in self.frames]}")

    def datagram(self, kind: str, to: int, body: bytes):
        self.socket.send(HEADER.pack(len(body), KIND[kind], 0, 0, to) + body)

    def wait(self, kind: str, seconds: float = 5) -> bytes:
        self.socket.settimeout(seconds)
        while True:
            raw = self.socket.recv(2048)
            if HEADER.unpack_from(raw)[1] == KIND[kind]:
                return raw[HEADER.size:]

    def take(self, seconds: float):
        """Reads one datagram, and acknowledges it."""
        self.socket.settimeout(seconds)
        try:
            raw = self.socket.recv(2048)
        except TimeoutError:
            return
        if HEADER.unpack_from(raw)[1] != KIND["data"]:
            return
        number, at, eliciting = struct.unpack_from("<Q", raw, HEADER.size)[0], HEADER.size + 8, False
        while at < len(raw):
            kind, length = struct.unpack_from("<BH", raw, at)
            content, at = raw[at + 3 : at + 3 + length], at + 3 + length
            eliciting = eliciting or kind not in (ACK, 4)
            if kind == ACK:
                self.acked = max(self.acked, struct.unpack_from("<Q", content)[0])
            elif kind == CONTENT:
                self.parts[struct.unpack_from("<Q", content)[0]] = content[8:]
        self.came.add(number)
        while (more := next((begin for begin, part in self.parts.items() if begin <= self.taken < begin + len(part)), None)) is not None:
            part = self.parts.pop(more)[self.taken - more:]
            self.taken += len(part)
            self.reader.feed(part)
        self.frames += self.reader.frames()
        if eliciting:
            last, run = max(self.came), 1
            while last - run in self.came:
                run += 1
            self.chunk(ACK, struct.pack("<QII", last, 0, run))

    def until(self, condition, seconds: float = 5) -> bool:
        end = time.monotonic() + seconds
        while not condition() and time.monotonic() < end:
            self.take(0.05)
        return bool(condition())

    def chunk(self, kind: int, content: bytes):
        self.datagram("data", self.theirs, struct.pack("<QBH", self.number, kind, len(content)) + content)
        self.number += 1

    def say(self, stream: bytes):
        """One datagram after the other, each repeated until it is acknowledged."""
        for begin in range(0, len(stream), PART):
            part = stream[begin : begin + PART]
            for _ in range(50):
                sent = self.number
                self.chunk(CONTENT, struct.pack("<Q", self.offset) + part)
                if self.until(lambda: self.acked >= sent, 0.1):
                    break
            else:
                raise ConnectionError("the listener acknowledges nothing")
            self.offset += len(part)

    def introduce(self, service: str, *schemas: str):
        """As the service of number 0."""
        self.say(control("introduce", service=service, fingerprints=[fingerprint(parse(text)) for text in schemas]))

    @staticmethod
    def request(id: int, number: int, packet: bytes, limit_s: float, again: bool = False) -> bytes:
        head = REQUEST.pack(0, int(limit_s * 1e9)) + struct.pack("<Q", number)
        return encode_frame("request", id, head + packet, NUMBERED | (AGAIN if again else 0))

    def close(self):
        self.datagram("closed", self.theirs, b"")
        self.socket.close()
