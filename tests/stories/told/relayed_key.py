"""A relay without the key, which passes the handshake of a peer on to another server, gets no session there."""
import os
import select
import socket
import sys
import threading
from pathlib import Path

from world import Failed, Rules, World

sys.path.insert(0, str(Path(__file__).resolve().parents[2] / "wire_reader"))
from frames import FrameReader  # noqa: E402


class Relay:
    """Accepts one caller after the other, passes its bytes on, and remembers the names of the frames."""

    def __init__(self, to: tuple[str, int]):
        self.to, self.asked, self.answered = to, [], []
        self.channel = socket.create_server(("127.0.0.1", 0))
        self.url = "tcp://127.0.0.1:%d" % self.channel.getsockname()[1]
        threading.Thread(target=self.serve, daemon=True).start()

    def serve(self):
        while True:
            try:
                caller, _ = self.channel.accept()
            except OSError:
                return
            with caller, socket.create_connection(self.to) as server:
                self.carry({caller: (server, FrameReader(), self.asked), server: (caller, FrameReader(), self.answered)})

    def carry(self, ends: dict):
        while True:
            for each in select.select(list(ends), [], [])[0]:
                other, reader, seen = ends[each]
                try:
                    if not (data := each.recv(65536)):
                        return
                    other.sendall(data)
                except OSError:
                    return
                reader.feed(data)
                seen += [frame.name for frame in reader.frames()]


def tell(world: World):
    key = world.folder / "system.key"
    key.touch(0o600)
    key.write_text(os.urandom(32).hex())
    # By the old scheme, whose frames can be read; over sealed sessions the relay sees none (tests/unit/net).
    os.environ["ISE_KEY_LEGACY"] = "1"
    secret = {"ISE_KEY": str(key)}
    names, host = ("127.0.0.1", world.free_port()), ("127.0.0.1", world.free_port())
    (world.folder / "programs").mkdir()
    world.name_server("--fresh", "--key", str(key), listen=f"tcp://{names[0]}:{names[1]}")
    world.run("host", ["ise_instantiation_server", "--programs", world.folder / "programs", "--state", world.folder / "state", "--name", "shore",
                       "--name-server", world.names, "--listen", f"tcp://{host[0]}:{host[1]}", "--key", key, "--log-level", "error"]).line("ise/host/shore")
    if "ise/host/shore" not in world.ise("--wait", "list", "--names", **secret).stdout:
        raise Failed("the system with a key does not work without anybody's doing")
    for what, command in (("its name server", ["list", "--names"]), ("an endpoint", ["ping", "-n", "1"])):
        relay = Relay(host)
        if what == "its name server":
            world.ise(*command, wait=4, ISE_NAME_SERVER=relay.url, **secret)
        else:
            world.ise(*command, relay.url, wait=4, **secret)
        relay.channel.close()
        if "hello" not in relay.asked:
            raise Failed(f"the relay that is taken for {what} was never called")
        world.expect("welcome" not in relay.answered, f"the instantiation server gave a session to the relay that is taken for {what}")
    world.judge(Rules())
