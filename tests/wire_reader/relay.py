"""A relay between two programs that records each session that goes through it, and can cut one."""
import asyncio
import time
from dataclasses import dataclass, field
from pathlib import Path

from recording import Chunk, Recorder


def parse_endpoint(text: str) -> tuple[str, ...]:
    """`tcp://host:port` or `local:///path` → ("tcp", host, port) or ("local", path)."""
    scheme, _, rest = text.partition("://")
    if scheme == "local" and rest:
        return "local", rest
    host, _, port = rest.rpartition(":")
    if scheme != "tcp" or not host or not port.isdigit():
        raise ValueError(f"'{text}' is no endpoint that a relay can serve: tcp://host:port or local://path is expected")
    return "tcp", host.strip("[]"), port


async def dial(text: str) -> tuple[asyncio.StreamReader, asyncio.StreamWriter]:
    kind, *where = parse_endpoint(text)
    if kind == "local":
        return await asyncio.open_unix_connection(where[0])
    return await asyncio.open_connection(where[0], int(where[1]))


@dataclass
class Relay:
    """Listens at `listen`, hands on to `to`, and writes session-1, session-2… into `folder`."""

    to: str
    folder: Path
    prefix: str = "session"
    chunk_bytes: int = 65536  # small: frames arrive in many parts
    sessions: list[Path] = field(default_factory=list)
    open: dict[asyncio.Task, list[asyncio.StreamWriter]] = field(default_factory=dict)
    flowing: asyncio.Event = field(default_factory=asyncio.Event)  # cleared: no more bytes or sessions of initiators
    server: asyncio.Server | None = None
    at: str = ""

    async def start(self, listen: str = "tcp://127.0.0.1:0"):
        self.flowing.set()
        kind, *where = parse_endpoint(listen)
        if kind == "local":
            self.server = await asyncio.start_unix_server(self.serve, where[0])
            self.at = listen
        else:
            self.server = await asyncio.start_server(self.serve, where[0], int(where[1]))
            self.at = f"tcp://{where[0]}:{self.server.sockets[0].getsockname()[1]}"

    async def serve(self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter):
        number = len(self.sessions) + 1
        file = self.folder / f"{self.prefix}-{number}.txt"
        self.sessions.append(file)
        await self.flowing.wait()
        try:
            far_reader, far_writer = await dial(self.to)
        except OSError:
            writer.transport.abort()  # as a provider that is not there
            file.touch()
            return
        task = asyncio.current_task()
        self.open[task] = [writer, far_writer]
        with open(file, "w", encoding="ascii", buffering=1) as into:
            recorder = Recorder(into)
            await asyncio.gather(self.pump("initiator", reader, far_writer, recorder),
                                 self.pump("responder", far_reader, writer, recorder))
        del self.open[task]

    async def pump(self, sender: str, reader: asyncio.StreamReader, writer: asyncio.StreamWriter, recorder: Recorder):
        try:
            while data := await reader.read(self.chunk_bytes):
                recorder.add(Chunk(time.monotonic_ns(), sender, data))
                writer.write(data)
                await writer.drain()
                if sender == "initiator":
                    await self.flowing.wait()
            recorder.add(Chunk(time.monotonic_ns(), sender, None))
            writer.write_eof()
        except OSError:  # one of the two is gone; the other pump learns it too
            writer.transport.abort()

    def cut(self):
        """Ends every session that is open, as a link that is lost does."""
        for writers in self.open.values():
            for writer in writers:
                writer.transport.abort()

    async def stop(self):
        """No new session; waits for the end of those that are open."""
        self.server.close()
        await asyncio.gather(*self.open)
