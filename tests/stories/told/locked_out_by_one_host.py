"""One host that takes all connections it can get keeps nobody else out: page, web hook, the boat's GPRS, names."""
import os
import resource
import socket
import struct
import subprocess
import threading
from contextlib import contextmanager

from gprs import login
from world import Rules, World

POST = b"POST /rockblock/mo HTTP/1.1\r\nHost: shore\r\nContent-Length: 0\r\nConnection: close\r\n\r\n"
EVENTS = b"GET /events HTTP/1.1\r\nHost: page\r\n\r\n"


@contextmanager
def crowd(world: World, to: tuple[str, int], many: int, says: bytes = b""):
    """So many connections of one host, for as long as this lasts."""
    all_ = []
    try:
        for _ in range(many):
            try:
                all_.append(world.dial("crowd", to, wait=1))
                if says:
                    all_[-1].sendall(says)
            except OSError:
                pass  # turned away: so much the better
        yield
    finally:
        for each in all_:
            each.close()


@contextmanager
def callers(world: World, to: tuple[str, int], every_s: float):
    """Connections of one host, one after the other, of which each stays for a while."""
    over, all_ = threading.Event(), []

    def call():
        while not over.wait(every_s):
            with world.on("crowd"):
                all_.append(socket.socket())
            all_[-1].setblocking(False)
            all_[-1].connect_ex(to)

    thread = threading.Thread(target=call)
    thread.start()
    try:
        yield
    finally:
        over.set()
        thread.join()
        for each in all_:
            each.close()


def greeting(world: World) -> bytes:
    """What the command line says first to a name server."""
    with world.on("crowd"), socket.create_server((world.addresses["crowd"], 7400)) as channel:
        channel.settimeout(10)
        subprocess.Popen(["nsenter", f"--net={world.namespaces['crowd']}", world.bin / "ise", "--timeout", "2s", "list"], stdin=subprocess.DEVNULL,
                                stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL,
                                env=os.environ | {"ISE_NAME_SERVER": f"tcp://{world.addresses['crowd']}:7400"})
        line, _ = channel.accept()
        with line:
            line.settimeout(10)
            head = line.recv(16, socket.MSG_WAITALL)
            return head + line.recv(struct.unpack_from("<I", head)[0], socket.MSG_WAITALL)


@contextmanager
def sessions(world: World, to: tuple[str, int], many: int, hello: bytes):
    """So many sessions of one host that want nothing, and come again where they are refused."""
    over, ping = threading.Event(), struct.pack("<IBBHQ", 0, 48, 0, 0, 1)
    all_: list[socket.socket] = []

    def hold():
        while not over.wait(0.5):
            for each in list(all_):
                try:
                    each.send(ping, socket.MSG_DONTWAIT)
                    if not each.recv(65536, socket.MSG_DONTWAIT):
                        raise ConnectionError
                except BlockingIOError:
                    pass
                except OSError:
                    each.close()
                    all_.remove(each)
            for _ in range(many - len(all_)):
                try:
                    all_.append(world.dial("crowd", to, wait=1))
                    all_[-1].sendall(hello)
                except OSError:
                    break

    thread = threading.Thread(target=hold)
    thread.start()
    try:
        yield
    finally:
        over.set()
        thread.join()
        for each in all_:
            each.close()


def tell(world: World):
    soft, hard = resource.getrlimit(resource.RLIMIT_NOFILE)
    resource.setrlimit(resource.RLIMIT_NOFILE, (min(hard, 8192), hard))
    world.hosts("shore", "crowd", "visitor")
    shore = world.addresses["shore"]
    page, hook, boat = (shore, 8080), (shore, 7480), (shore, 7420)
    world.name_server("--fresh", host="shore")
    world.atirma("page", "web-server", "--address", shore, "--port", "8080", host="shore", ready="http://")
    key = world.folder / "gateway.pem"
    world.make_key(key)
    world.atirma("hook", "iridium-proxy", "--imei", "300234010753370", "--database", world.folder / "iridium.db", "--webhook", f"tcp://{shore}:7480",
                 "--jwt-key", key, "--send-by", "none", host="shore")
    world.atirma("gprs", "gprs-proxy", "--boat-listen", f"tcp://{shore}:7420", host="shore", ready="ready:")
    world.way("visitor", "shore", delay_ms=50)

    def visited() -> bool:
        return world.page_answers(page, "visitor", wait=3)

    def posted() -> bool:
        return world.ask(hook, POST, b"HTTP/1.1 4", "visitor", wait=3)

    def streamed() -> bool:
        return world.ask(page, EVENTS, b"event: snapshot", "visitor", wait=3)

    def logged_in() -> bool:
        # The first packet behind the connection's beginning was lost, and came again after a second.
        return world.ask(boat, login(7), b"$PATA,7,", "visitor", wait=3, pause=1)

    for what, answers in (("page", visited), ("page's stream", streamed), ("web hook", posted), ("boat's login", logged_in)):
        world.expect(answers(), f"the {what} does not answer although nobody else is there")
    with crowd(world, page, 4000):
        world.expect(world.until(visited, 6), "4,000 idle connections of one host keep all others off the page")
    with crowd(world, page, 2000, EVENTS):
        world.expect(world.until(streamed, 6), "2,000 event streams of one host keep all others from theirs")
    with crowd(world, hook, 100):
        world.expect(world.until(posted, 6), "100 idle connections of one host keep the gateway off the web hook")
    with callers(world, boat, 0.02):
        world.sleep(1)
        world.expect(world.until(logged_in, 6), "50 connections a second of one host keep the boat from logging in")
    few = world.run("few", ["/bin/sh", "-c", 'ulimit -n 160 && exec "$@"', "sh", world.bin / "ise_name_server", "--fresh", "--state", "none",
                            "--listen", f"tcp://{shore}:7405"], "shore")
    few.line("tcp://")

    def listed() -> bool:
        return world.ise("list", host="visitor", wait=5, ISE_NAME_SERVER=f"tcp://{shore}:7405").returncode == 0

    world.expect(listed(), "the name server does not answer although nobody else is there")
    with sessions(world, (shore, 7405), 144, greeting(world)):
        world.sleep(5)
        world.expect(listed(), "144 sessions of one host keep all others off a name server that may open 160 files")
    world.judge(Rules())
