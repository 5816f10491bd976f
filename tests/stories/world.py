"""The parts of a story: hosts behind a router, processes on them, faults, and the logs that the checker reads."""
import json
import os
import random
import resource
import shutil
import signal
import socket
import subprocess
import sys
import tempfile
import time
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Callable

from checker import Rules, check, read

HERE = Path(__file__).resolve().parent


class Skipped(Exception):
    """This machine or user lacks something that the story needs."""


class Failed(Exception):
    """The story could not be told to its end."""


class Process:
    """A child in its own process group; its two outputs are files of the story's folder."""

    def __init__(self, world: "World", name: str, command: list[str], host: str | None, variables: dict[str, str]):
        self.name, self.world, self.command, self.host, self.variables = name, world, command, host, variables
        self.start()

    def start(self):
        self.out, self.err = (self.world.folder / f"{self.name}.{which}" for which in ("out", "err"))
        self.from_byte = self.out.stat().st_size if self.out.exists() else 0
        inside = ["nsenter", f"--net={self.world.namespaces[self.host]}"] if self.host else []  # replaces itself: the pid is the program's
        with self.out.open("ab") as out, self.err.open("ab") as err:
            self.child = subprocess.Popen([*inside, *self.command], stdin=subprocess.DEVNULL, stdout=out, stderr=err,
                                          env=os.environ | self.variables, start_new_session=True)

    def said(self) -> str:
        """Its standard output since it was started last."""
        return self.out.read_bytes()[self.from_byte:].decode(errors="replace")

    def line(self, word: str = "", wait: float = 20) -> str:
        """The first line of its output with that word, once it is whole."""
        def find():
            lines = self.said().split("\n")[:-1]
            return next((each for each in lines if word in each), None)

        if (found := self.world.until(find, wait, lambda: self.child.poll() is not None)) is None:
            raise Failed(f"{self.name} did not say '{word}': {self.said()}{self.err.read_text()[-2000:]}")
        return found

    def shift_clock(self, seconds: int):
        """From its next start on its wall clock is so far off."""
        self.variables |= {"LD_PRELOAD": str(self.world.bin / "libstory_shifted_clock.so"), "STORY_CLOCK_SHIFT_S": str(seconds)}

    def signal(self, number: int):
        assert self.child.pid > 1 and self.child.poll() is None, f"{self.name} has ended"
        self.child.send_signal(number)

    def stop(self):
        self.world.note("away", self.name)
        self.signal(signal.SIGSTOP)

    def go_on(self):
        self.signal(signal.SIGCONT)
        self.world.note("back", self.name)

    def kill(self):
        self.world.note("killed", self.name)
        self.signal(signal.SIGKILL)
        self.child.wait()

    def restart(self):
        """Again, with the same command."""
        if self.child.poll() is None:
            self.kill()
        self.start()

    def end(self, wait: float = 20) -> int:
        if self.child.poll() is None:
            self.signal(signal.SIGCONT)
            self.signal(signal.SIGTERM)
        try:
            return self.child.wait(wait)
        except subprocess.TimeoutExpired:
            raise Failed(f"{self.name} does not end") from None

    @contextmanager
    def no_descriptors(self):
        """It can open nothing (EMFILE) as long as this lasts."""
        before = resource.prlimit(self.child.pid, resource.RLIMIT_NOFILE)
        used = [int(each) for each in os.listdir(f"/proc/{self.child.pid}/fd")]
        free = next(n for n in range(len(used) + 1) if n not in used)
        resource.prlimit(self.child.pid, resource.RLIMIT_NOFILE, (free, before[1]))
        try:
            yield
        finally:
            resource.prlimit(self.child.pid, resource.RLIMIT_NOFILE, before)


class World:
    """Everything that one story makes; `close` removes it, except a folder that the user named."""

    def __init__(self, build: Path, seed: int, folder: Path | None = None):
        self.bin, self.seed, self.dice = build / "bin", seed, random.Random(seed)
        self.given_ports: set[int] = set()
        self.kept = folder is not None
        self.folder = folder or Path(tempfile.mkdtemp(prefix="ise-story-"))
        self.folder.mkdir(parents=True, exist_ok=True)
        os.environ["XDG_STATE_HOME"] = str(self.folder / "state-home")  # what programs keep by themselves is the story's, too
        self.processes: dict[str, Process] = {}
        self.namespaces: dict[str, str] = {}
        self.router: subprocess.Popen | None = None
        self.undo: list[Callable[[], object]] = []
        self.wrong: list[str] = []

    def close(self):
        for each in self.processes.values():
            if each.child.poll() is None:
                each.child.kill()
                each.child.wait()
        if self.router:
            self.router.stdin.close()
            self.router.wait(10)
        for step in reversed(self.undo):
            step()
        if not self.kept:
            shutil.rmtree(self.folder, ignore_errors=True)

    # --- the network ----------------------------------------------------------------------------------------------

    def hosts(self, *names: str):
        """Network namespaces with the addresses 10.77.0.1, 10.77.0.2, … in this order, and the router between them."""
        if os.geteuid() != 0:
            raise Skipped("network namespaces need root")
        if not os.access("/dev/net/tun", os.W_OK):
            raise Skipped("the router between the namespaces needs /dev/net/tun")
        self.addresses = {name: f"10.77.0.{n}" for n, name in enumerate(names, 1)}
        self.router = subprocess.Popen([sys.executable, "-B", str(HERE / "router.py"), str(self.seed),
                                        *(f"{name}={address}" for name, address in self.addresses.items())],
                                       stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True)
        told = self.router.stdout.readline()
        if not told:
            raise Skipped("no network namespaces with TUN devices can be made here")
        self.namespaces = json.loads(told)

    def tell_router(self, command: str) -> str:
        self.router.stdin.write(command + "\n")
        self.router.stdin.flush()
        answer = self.router.stdout.readline().strip()
        if answer != "ok" and not answer.startswith("{"):
            raise Failed(f"router: {command}: {answer}")
        return answer

    def way(self, a: str, b: str, **settings: float):
        """Both directions between two hosts: way("boat", "shore", loss=0.1, delay_ms=20)."""
        words = " ".join(f"{name}={value}" for name, value in settings.items())
        for one, other in ((a, b), (b, a)):
            self.tell_router(f"set {one} {other} {words}")

    def cut(self, a: str, b: str):
        self.way(a, b, up=0)

    def heal(self, a: str, b: str):
        self.way(a, b, up=1)

    def reset(self, a: str, b: str):
        """An RST for each TCP connection between two hosts, with its next packet."""
        self.tell_router(f"reset {a} {b}")

    @contextmanager
    def on(self, host: str | None):
        """Sockets that this thread makes belong to that host."""
        if host is None:
            yield
            return
        import ctypes
        setns = ctypes.CDLL(None, use_errno=True).setns
        with open("/proc/self/ns/net") as home, open(self.namespaces[host]) as there:
            if setns(there.fileno(), 0) != 0:
                raise Failed("setns")
            try:
                yield
            finally:
                setns(home.fileno(), 0)

    def dial(self, host: str | None, address: tuple[str, int], wait: float = 5) -> socket.socket:
        with self.on(host):
            made = socket.socket()
        made.settimeout(wait)
        made.connect(address)
        return made

    def free_port(self) -> int:
        """Of this machine's loopback, free a moment ago, and none that the system gives to connections."""
        for port in random.sample(range(20000, 32000), 500):
            with suppress(OSError), socket.socket() as probe:
                probe.bind(("127.0.0.1", port))
                if port not in self.given_ports:
                    self.given_ports.add(port)
                    return port
        raise RuntimeError("no free port")

    def ask(self, address: tuple[str, int], question: bytes, word: bytes, host: str | None = None, wait: float = 5, pause: float = 0) -> bool:
        """Whether the listener answers with that word in time. `pause` seconds lie between the connection and the question."""
        came = b""
        try:
            with self.dial(host, address, wait) as line:
                time.sleep(pause)
                line.sendall(question)
                end = time.monotonic() + wait
                while word not in came and time.monotonic() < end:
                    if not (more := line.recv(65536)):
                        break
                    came += more
        except OSError:
            pass
        return word in came

    def page_answers(self, address: tuple[str, int], host: str | None = None, wait: float = 5) -> bool:
        return self.ask(address, b"GET /api/status HTTP/1.1\r\nHost: page\r\nConnection: close\r\n\r\n", b"HTTP/1.1 200", host, wait)

    # --- processes ------------------------------------------------------------------------------------------------

    def run(self, name: str, command: list[str], host: str | None = None, **variables: str) -> Process:
        """Starts a program of this build (or one with a path)."""
        file = command[0] if "/" in command[0] else str(self.bin / command[0])
        self.processes[name] = Process(self, name, [file, *map(str, command[1:])], host, variables)
        return self.processes[name]

    def party(self, role: str, name: str, where: str, host: str | None = None, **settings) -> Process:
        """story_party, with its log; once it runs. Of a provider `line()` is its endpoint."""
        words = [f"hush={self.folder / 'hush'}", *(f"{key}={value}" for key, value in settings.items())]
        made = self.run(name, ["story_party", role, self.folder / f"{name}.log", where, *words], host)
        made.line()
        return made

    def name_server(self, *options: str, host: str | None = None, listen: str = "tcp://127.0.0.1:0") -> str:
        made = self.run("names", ["ise_name_server", "--listen", listen, "--log-level", "error", *options], host)
        line = made.line("tcp://")
        self.names = line[line.index("tcp://"):]
        return self.names

    def atirma(self, name: str, type_: str, *options: str, host: str | None = None, ready: str = "", **variables: str) -> Process:
        made = self.run(name, ["atirma", "run", "--log-level", "warning", type_, *options], host, ISE_NAME_SERVER=getattr(self, "names", ""), **variables)
        made.line(ready)
        return made

    def ise(self, *words: str, host: str | None = None, wait: float = 30, **variables: str) -> subprocess.CompletedProcess:
        """The command line, as a person uses it, to its end."""
        inside = ["nsenter", f"--net={self.namespaces[host]}"] if host else []
        return subprocess.run([*inside, str(self.bin / "ise"), "--timeout", f"{wait:.0f}s", *words], stdin=subprocess.DEVNULL, capture_output=True,
                              text=True, timeout=wait + 15, env=os.environ | {"ISE_NAME_SERVER": getattr(self, "names", "")} | variables)

    def epoch_of(self, path: str) -> int:
        """Of the name's grant, as soon as there is one."""
        def listed() -> int:
            return next((int(each["epoch"]) for each in json.loads(self.ise("--json", "list").stdout or "[]") if each["path"] == path), 0)

        return self.until(listed, 10)

    def call(self, whom: str, service: str, request: dict, **how) -> dict | None:
        """The response, or None where the call failed."""
        ran = self.ise("--wait", "--json", "--as", "story/operator", "call", whom, service, json.dumps(request), **how)
        return json.loads(ran.stdout) if ran.returncode == 0 else None

    def next_of(self, whom: str, service: str, **how) -> dict | None:
        """The next packet that it publishes."""
        ran = self.ise("--wait", "--json", "echo", "--count", "1", whom, service, **how)
        return json.loads(ran.stdout.splitlines()[0]) if ran.returncode == 0 and ran.stdout.strip() else None

    @staticmethod
    def make_key(file: Path):
        """A public key for tokens; its private key is thrown away."""
        private = subprocess.run(["openssl", "genrsa", "2048"], check=True, capture_output=True).stdout
        file.write_bytes(subprocess.run(["openssl", "rsa", "-pubout"], input=private, check=True, capture_output=True).stdout)

    def small_disk(self, size: str) -> Path:
        """A folder that holds no more than that."""
        if os.geteuid() != 0:
            raise Skipped("a small disk needs root")
        made = self.folder / f"disk-{size}"
        made.mkdir()
        subprocess.run(["mount", "-t", "tmpfs", "-o", f"size={size},mode=0700", "tmpfs", str(made)], check=True)
        self.undo.append(lambda: subprocess.run(["umount", "-l", str(made)], check=False))
        return made

    def hush(self):
        """No provider publishes and no requester calls any more."""
        (self.folder / "hush").touch()

    # --- time and judgement ---------------------------------------------------------------------------------------

    @staticmethod
    def sleep(seconds: float):
        """The length of a fault; never a way to wait for a result."""
        time.sleep(seconds)

    @staticmethod
    def until(condition: Callable[[], object], wait: float = 30, hopeless: Callable[[], bool] = lambda: False):
        """Returns the value of the condition as soon as it is true; after `wait` seconds, its last value."""
        end = time.monotonic() + wait
        while not (got := condition()) and time.monotonic() < end:
            if hopeless():
                return condition()
            time.sleep(0.05)
        return got

    def expect(self, held: object, broken: str):
        if not held:
            self.wrong.append(broken)

    def note(self, what: str, who: str = ""):
        """For the history of grants (grants.py): what the story did to a holder."""
        with (self.folder / "story.grants.jsonl").open("a") as history:
            history.write(json.dumps({"at": time.monotonic_ns(), "what": what, "who": who}) + "\n")

    def judge(self, rules: Rules):
        """Ends all parties and reads what they wrote."""
        (self.folder / "story.log").write_text(f"{time.monotonic_ns()} end\n")
        for name, each in self.processes.items():
            if "story_party" in each.command[0] and each.child.poll() is None and (code := each.end()) != 0:
                self.wrong.append(f"{name} ended with {code}")
        self.wrong += check(read(self.folder), rules)
