"""What a boat, a peer or an operator says is shown as text: the console opens no file that a notice names, no byte of it reaches a terminal
through a log, and operators without a path never share an authority."""
import ctypes
import json
import os
import select
import shutil
import socket
import struct
import sys
import tempfile
import threading
from pathlib import Path

from boat import packet
from gprs import login, record
from world import Failed, Rules, World

sys.path.insert(0, str(Path(__file__).resolve().parents[2] / "wire_reader"))
from frames import FrameReader, control, encode_frame  # noqa: E402

BOOT, NOTICE = 9, 8
HOSTILE = b"evil\x1b[31m\x9b31m\xc2\x9b31m\xe2\x80\xae"  # red by ESC, by one byte, by its UTF-8, and backwards


class OpenedFiles:
    """Tells whether anybody opened a file since the last question."""

    def __init__(self, file: Path):
        libc = ctypes.CDLL(None, use_errno=True)
        self.events = libc.inotify_init1(os.O_NONBLOCK)
        if self.events < 0 or libc.inotify_add_watch(self.events, bytes(file), 0x20) < 0:  # IN_OPEN
            raise Failed(f"cannot watch {file}: {os.strerror(ctypes.get_errno())}")

    def any(self) -> bool:
        return bool(select.select([self.events], [], [], 0)[0]) and bool(os.read(self.events, 65536))


class HostileBoat:
    """Logs in over GPRS and says the same things again and again."""

    def __init__(self, channel: tuple[str, int], texts: list[bytes]):
        self.texts, self.over, self.said = texts, threading.Event(), 0
        self.line = socket.create_connection(channel)
        self.line.sendall(login(BOOT))
        self.thread = threading.Thread(target=self.talk, daemon=True)
        self.thread.start()

    def talk(self):
        while not self.over.wait(0.2):
            for text in self.texts:
                self.said += 1
                body = struct.pack("<B", len(text)) + text
                self.line.sendall(record(BOOT, self.said, packet(NOTICE, BOOT, self.said, body)))

    def leave(self):
        self.over.set()
        self.thread.join()
        self.line.close()


def speak_as(name: bytes, where: str) -> list[str]:
    """A peer of that name that breaks off in the middle of the protocol; the frames that it got."""
    host, _, port = where.removeprefix("tcp://").rpartition(":")
    reader, got = FrameReader(), []
    with socket.create_connection((host, int(port)), 5) as line:
        line.sendall(control("hello", self={"path": name, "host_name": name, "process_key": name, "incarnation": 1}))
        broken = False
        while data := line.recv(65536):
            reader.feed(data)
            got += [frame.name for frame in reader.frames()]
            if "welcome" in got and not broken:
                broken = True
                line.sendall(encode_frame("request", 0, b"short"))
    return got


def escapes(text: bytes) -> list[str]:
    """The characters of it that a terminal obeys, or that are no UTF-8."""
    shown = text.decode("utf-8", "surrogateescape")
    return sorted({hex(ord(each)) for each in shown
                   if each != "\n" and (ord(each) < 0x20 or 0x7F <= ord(each) < 0xA0 or 0xD800 <= ord(each) < 0xE000 or each == "\u202e")})


def tell(world: World):
    world.name_server("--fresh")
    channel = ("127.0.0.1", world.free_port())
    world.atirma("gprs", "gprs-proxy", "--boat-listen", f"tcp://{channel[0]}:{channel[1]}", "--listen", "tcp://127.0.0.1:0", ready="ready:")
    world.atirma("node", "communication-node", "--path", "atirma/shore/one", "--file", world.folder / "one.db", "--proxy", "gprs=atirma/shore/gprs")
    short = Path(tempfile.mkdtemp(prefix="ise-"))  # a notice has 80 bytes at most
    world.undo.append(lambda: shutil.rmtree(short))
    picture = short / "a.png"
    picture.write_bytes(b"no picture")
    opened = OpenedFiles(picture)
    picture.read_bytes()
    if not opened.any():
        raise Failed("it cannot be seen that a file is opened")
    boat = HostileBoat(channel, [f"<img src='{picture}'>".encode(), HOSTILE])

    def listed() -> list[dict]:
        return json.loads(world.ise("--json", "list").stdout or "[]")

    if (world.bin / "atirma_console").exists():  # it is built where Qt is installed
        # The console shows the notices in its list about the boat.
        console = world.run("console", ["atirma_console", "--name-server", world.names, "--name", "ana", "--settings", "none", "--tab", "boat",
                                        "--size", "1280x1400", "--after", "10", "--screenshot", world.folder / "console.png"])

        def heard() -> bool:
            """Whether the console is subscribed to the boat's telemetry."""
            path = next((each["path"] for each in listed() if each["path"].startswith("atirma/console/")), None)
            ran = world.ise("--json", "describe", path) if path else None
            return bool(ran and ran.returncode == 0 and any("gprs" in session["peer"] and "telemetry" in session["uses"] and session["bytes_in"] > 2000
                                                            for session in json.loads(ran.stdout)["sessions"]))

        world.expect(world.until(heard, 10), "the console does not hear the boat: the story proves nothing")
        world.expect(world.until(lambda: console.child.poll() is not None, 30) is True, "the console does not end")
        world.expect(console.child.poll() == 0, f"the console ended with {console.child.poll()}: {console.err.read_text()}")
        world.expect(not opened.any(), "the console opened a file that a notice of the boat names")
    boat.leave()

    # A peer whose name is made for terminals breaks the protocol, which is logged.
    endpoint = next(each for each in listed() if each["path"] == "atirma/shore/gprs")["endpoints"][0]
    world.expect("goodbye" in speak_as(HOSTILE, endpoint), "the proxy goes on with a peer that breaks the protocol")
    log = world.processes["gprs"].err
    world.expect(world.until(lambda: b"evil" in log.read_bytes(), 10), "the proxy does not log the peer that broke the protocol")
    for file in world.folder.glob("*.err"):
        world.expect(not escapes(file.read_bytes()), f"{file.name} has bytes that terminals obey: {escapes(file.read_bytes())}")

    # Two operators without a path, of one host.
    def authority(action: str, *who: str):
        request = json.dumps({"action": action, "confirmed": True})
        return world.ise("--wait", "--json", *who, "call", "atirma/communication", "authority", request)

    def holder() -> str:
        return json.loads(authority("look").stdout)["holder"]

    def hold(id: int, *who: str):
        request = json.dumps({"id": id, "command": {"kind": "set_mode", "mode": "hold"}, "valid_s": 5})
        return world.ise("--wait", "--json", *who, "call", "atirma/communication", "telecommand", request, wait=10)

    world.expect(authority("take").returncode != 0, "an operator without a path takes the authority")
    world.expect(holder() == "", f"'{holder()}' holds the authority")
    world.expect("nobody holds the authority" in hold(1).stderr, "a telecommand of another operator without a path goes out")
    world.expect(authority("take", "--as", "story/ana").returncode == 0, "an operator with a path does not get the authority")
    for action in ("take", "release"):
        world.expect(authority(action).returncode != 0, f"an operator without a path can {action} the authority of another")
    world.expect("story/ana holds the authority" in hold(2).stderr, "a telecommand of an operator without a path goes out under another's authority")
    world.expect(holder() == "story/ana", f"'{holder()}' holds the authority, not story/ana")
    world.judge(Rules())
