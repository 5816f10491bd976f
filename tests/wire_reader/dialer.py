"""A peer in Python: shakes hands with a program, asks it for the schemas that a recording names, calls it."""
import asyncio
import hmac
import os
from typing import Any, Iterable

import schema
from frames import NONCE, REQUEST, SCHEME, Frame, FrameReader, control, encode, encode_frame, prove, read_body
from relay import dial
from sealing import dial_sealed

AT_ONCE = 64  # fingerprints of one schema_request


def raw(frame: Frame) -> bytes:
    return encode_frame(frame.type, frame.id, frame.body, frame.flags)


class Peer:
    """An anonymous initiator, without a shared key, with one by the old scheme, or in a `sealed` session. Raises
    ConnectionError where the other side says no or leaves."""

    def __init__(self, key: bytes | None = None, sealed: bytes | None = None):
        self.key, self.sealed = key, sealed
        self.reader = FrameReader()
        self.waiting: list[Frame] = []

    async def connect(self, to: str) -> dict[str, Any]:
        self.from_peer, self.to_peer = await (dial_sealed(to, self.sealed, dial) if self.sealed else dial(to))
        identity = {"host_name": "python", "process_key": "wire_reader", "incarnation": 1}
        if self.key is None:
            self.to_peer.write(control("hello", self=identity))
            return read_body("welcome", (await self.next("welcome")).body)[0]
        hello = control("hello", self=identity, authentication={"scheme": SCHEME, "proof": list(os.urandom(NONCE))})
        self.to_peer.write(hello)
        before = hello + raw(await self.next("challenge"))
        own = control("proof", scheme=SCHEME, proof=list(prove(self.key, "initiator", before)))
        self.to_peer.write(own)
        welcome = await self.next("welcome")
        theirs = read_body("proof", (await self.next("proof")).body)[0]
        if not hmac.compare_digest(bytes(theirs["proof"]), prove(self.key, "responder", before + own + raw(welcome))):
            raise ConnectionError("the peer does not know the key")
        return read_body("welcome", welcome.body)[0]

    async def next(self, *names: str) -> Frame:
        """The next frame of one of these types; answers pings on the way and passes the rest over."""
        while True:
            while not self.waiting:
                data = await self.from_peer.read(65536)
                if not data:
                    raise ConnectionError(f"the peer left while a {' or '.join(names)} was awaited")
                self.reader.feed(data)
                self.waiting += self.reader.frames()
            frame = self.waiting.pop(0)
            if frame.name in names:
                return frame
            if frame.name == "ping":
                self.to_peer.write(encode_frame("pong", frame.id))
            if frame.name in ("reject", "goodbye"):
                raise ConnectionError(f"{frame.name}: {read_body(frame.name, frame.body)[0]['reason'].decode()}")

    async def texts(self, fingerprints: Iterable[int]) -> dict[int, str]:
        """The schema texts that the peer knows. Raises ValueError where one is not what it was asked for."""
        out, wanted = {}, sorted(set(fingerprints))
        for begin in range(0, len(wanted), AT_ONCE):
            some = wanted[begin : begin + AT_ONCE]
            self.to_peer.write(control("schema_request", fingerprints=some))
            for _ in some:
                said = read_body("schema", (await self.next("schema")).body)[0]
                if said["text"]:
                    if (made := schema.fingerprint(schema.parse(said["text"]))) not in some:
                        raise ValueError(f"the peer sent the schema of {made:#x}, which it was not asked for")
                    out[made] = said["text"].decode("utf-8", "surrogateescape")
        return out

    async def call(self, service: str, request: str, response: str, value: dict[str, Any]) -> Frame:
        """Calls a service whose two schema texts are given; its reply or error. One call a session."""
        types = [schema.parse(text) for text in (request, response)]
        self.to_peer.write(control("introduce", service=service, fingerprints=[schema.fingerprint(each) for each in types]))
        minute_ns = 60_000_000_000
        self.to_peer.write(encode_frame("request", 0, REQUEST.pack(0, minute_ns) + encode(types[0], value)))
        return await self.next("reply", "error")

    async def leave(self):
        self.to_peer.write(control("goodbye", code=6, reason="nothing more to ask"))
        self.to_peer.close()
        await self.to_peer.wait_closed()


async def learn(to: str, fingerprints: Iterable[int], key: bytes | None = None) -> dict[int, str]:
    """What the program at `to` knows of these schemas."""
    peer = Peer(key)
    await peer.connect(to)
    texts = await peer.texts(fingerprints)
    await peer.leave()
    return texts
