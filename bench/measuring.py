"""What the programs of bench/ share: cases, running a program on its cores, medians, and the line of progress."""

import datetime
import json
import os
import platform
import select
import shutil
import statistics
import subprocess
import sys
import threading
import time
from dataclasses import dataclass, replace
from math import comb
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
BIN = ROOT / "build" / "release" / "bin"
PEERS = ("zeromq", "omniorb", "ice", "cyclone", "grpc", "nats")
NAMES = {"zeromq": "ZeroMQ", "omniorb": "omniORB", "ice": "Ice", "cyclone": "Cyclone DDS", "grpc": "gRPC", "nats": "NATS",
         "raw": "raw sockets", "asio": "bare Asio", "ise": "ISE", "ise-fast": "ISE, its fast forms",
         "ise-poll": "ISE, polling"}


@dataclass(frozen=True)
class Case:
    work: str
    transport: str
    size: int = 64
    outstanding: int = 1
    subscribers: int = 1
    services: int = 1

    @property
    def name(self):
        size = size_text(self.size)
        if self.work == "call":
            return f"call {size}, {self.outstanding} outstanding, {self.transport}"
        if self.work == "publish":
            return f"publish {size}, 1:{self.subscribers}, {self.transport}"
        return f"one-way {size} at 1 kHz, {self.transport}"

    @property
    def by_latency(self):
        """Whether p50 is compared; else the rate."""
        return self.work == "paced" or self.outstanding == 1 and self.work == "call"

    @property
    def in_process(self):
        """Whether one process does both sides of ISE: on two threads, or on one loop."""
        return self.transport in ("inproc", "oneloop")

    def floors(self):
        """(program, kind), the first is 1.00. Of shared memory and between threads it is the local socket."""
        if self.transport == "oneloop":
            return [("bench_floor", "asio")]
        found = [("bench_floor", "raw")]
        if self.work == "call" and self.outstanding == 1 and self.transport not in ("udp", "inproc", "shm"):
            found.append(("bench_floor", "asio"))
        return found

    def options(self):
        given = ["--transport", self.transport, "--size", str(self.size), "--outstanding", str(self.outstanding),
                 "--subscribers", str(self.subscribers)]
        return given + (["--services", str(self.services)] if self.services > 1 else [])

    def value(self, outcome):
        """What is compared, of one run's JSON."""
        return outcome["latency_ns"]["p50"] if self.by_latency else outcome["per_s"]

    def show(self, value):
        return duration(value) if self.by_latency else rate(value)


CASES = [
    Case("call", transport, size, outstanding)
    for transport in ("tcp", "local", "shm", "inproc") for outstanding in (1, 64) for size in (64, 1024, 65536)
] + [
    Case("publish", transport, size, 1, subscribers)
    for transport in ("tcp", "local", "shm", "inproc") for size, subscribers in ((64, 1), (1024, 1), (65536, 1), (64, 8))
] + [Case("call", "oneloop", size) for size in (64, 1024, 65536)] + [Case("call", "udp")] + [Case("paced", transport) for transport in ("tcp", "local", "inproc")]


class Failed(Exception):
    pass


class NotOffered(Exception):
    """The program says (exit code 2) that it does not do this."""


def run_once(program, kind, case, cores, seconds, patience=30):
    """The JSON of one run. `cores`: of the serving and of the measuring process."""
    if program == "bench_floor" and case.transport in ("inproc", "shm"):
        case = replace(case, transport="local")
    common = [case.work, "--kind", kind, *case.options()]
    measure = ["taskset", "-c", cores[1], str(BIN / program), *common, "--seconds", str(seconds), "--warmup", str(min(0.3, seconds / 3))]
    if case.in_process:
        measure[2] = ",".join(sorted(set(cores)))  # its threads share what the two processes would have
        return finish(measure, seconds + patience)
    server = subprocess.Popen(["taskset", "-c", cores[0], str(BIN / program), "serve", *common],
                              stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
    try:
        ready, _, _ = select.select([server.stdout], [], [], 20)
        address = server.stdout.readline().strip() if ready else ""
        if not address:
            server.stdin.close()
            if ready and server.wait(timeout=5) == 2:
                raise NotOffered(server.stderr.read().splitlines()[0])
            raise Failed(f"{program} serve {' '.join(common)}: printed no address" + (": " + server.stderr.read() if ready else ""))
        return finish([*measure, "--connect", address], seconds + patience)
    finally:
        server.stdin.close()  # it ends by that
        try:
            server.wait(timeout=5)
        except subprocess.TimeoutExpired:
            server.kill()
            server.wait()
        server.stdout.close()
        server.stderr.close()


def finish(command, patience):
    try:
        done = subprocess.run(command, capture_output=True, text=True, stdin=subprocess.DEVNULL, timeout=patience)
    except subprocess.TimeoutExpired:
        raise Failed(f"{' '.join(command)}: did not end") from None
    if done.returncode == 2:
        raise NotOffered((done.stderr or "exit code 2").splitlines()[0])
    if done.returncode:
        raise Failed(f"{' '.join(command)}: exit code {done.returncode}: {done.stderr.strip()}")
    return json.loads(done.stdout)


def interval(values):
    """The median with an interval that holds it with 95 % (order statistics; with less than 6 values: all of them)."""
    values = sorted(values)
    n = len(values)
    low = 0
    while low + 1 < n // 2 and 1 - 2 * sum(comb(n, k) for k in range(low + 2)) / 2**n >= 0.95:
        low += 1
    return statistics.median(values), values[low], values[n - 1 - low]


def ratios(case, rounds, floor):
    """Round by round; both are lists of JSON or None."""
    return [case.value(one) / case.value(base) for one, base in zip(rounds, floor) if one and base and case.value(base)]


def size_text(size):
    return f"{size >> 20} MiB" if size >= 1 << 20 else f"{size >> 10} KiB" if size >= 1024 else f"{size} B"


def duration(ns):
    return f"{ns:.0f} ns" if ns < 1000 else f"{ns / 1000:.1f} µs" if ns < 1e6 else f"{ns / 1e6:.2f} ms"


def rate(per_s):
    return f"{per_s:.0f}/s" if per_s < 1e4 else f"{per_s / 1e3:.0f} k/s" if per_s < 1e6 else f"{per_s / 1e6:.2f} M/s"


def label(who):
    program, kind = who
    return NAMES.get(kind, kind)


def modes():
    """Where the serving and the measuring process run."""
    cores = [str(core) for core in sorted(os.sched_getaffinity(0))]
    found = {"one": (cores[0], cores[0])}
    if len(cores) > 1:
        found["each"] = (cores[0], cores[1])
    return found


def machine():
    model = next((line.split(":", 1)[1].strip() for line in Path("/proc/cpuinfo").read_text().splitlines() if line.startswith("model name")), "?")
    commit = subprocess.run(["git", "-C", str(ROOT), "rev-parse", "--short", "HEAD"], capture_output=True, text=True, check=False).stdout.strip()
    return {"cpu": model, "cores": os.cpu_count(), "kernel": platform.release(), "commit": commit,
            "date": datetime.datetime.now(datetime.timezone.utc).date().isoformat()}


def command_line(name):
    """How the script `name` was called, without the file for its JSON: where that is kept says nothing."""
    words = sys.argv[1:]
    if "--json" in words:
        del words[words.index("--json"):words.index("--json") + 2]
    return " ".join([name, *words])


def build(*targets, preset="release"):
    """A build of the targets, by default the release build; for peers what is missing is installed before, or told of."""
    subprocess.run([str(ROOT / "cmake" / "install-packages"), "build"], check=True, stdout=sys.stderr)
    if "bench_peers" in targets and subprocess.run([str(ROOT / "cmake" / "install-packages"), "peers"], check=False, stdout=sys.stderr).returncode:
        print("bench: not every peer could be installed: those that are there are measured", file=sys.stderr)
    own = [target for target in targets if target != "bench_peers"]
    subprocess.run([str(ROOT / "cmake" / "build"), preset, *own], check=True, stdout=sys.stderr)
    if "bench_peers" in targets:  # as many of them as can be built
        subprocess.run(["cmake", "--build", "--preset", "release", "--target", "bench_peers", "--", "-k0"], cwd=ROOT, check=False, stdout=sys.stderr)


class Progress:
    """A line on a terminal's standard error, twice a second: what is measured, and the time left. Elsewhere nothing."""

    def __init__(self, runs):
        self.runs, self.begun, self.text, self.began = runs, 0, "", time.monotonic()
        self.lock, self.over = threading.Lock(), threading.Event()
        self.shown = sys.stderr.isatty()
        if self.shown:
            threading.Thread(target=self.draw, daemon=True).start()

    def begin(self, text):
        self.text, self.begun = text, self.begun + 1

    def line(self, now):
        done, passed = max(0, self.begun - 1), now - self.began
        left = f"about {length(passed / done * (self.runs - done))} left" if done else "…"
        return f"{100 * done // self.runs:3} %  {length(passed)}, {left}  {self.text}"

    def draw(self):
        while not self.over.wait(0.5):
            columns = shutil.get_terminal_size().columns
            with self.lock:
                print(f"\r\033[K{self.line(time.monotonic())[:columns - 1]}", end="", file=sys.stderr, flush=True)

    def clear(self):
        if self.shown:
            print("\r\033[K", end="", file=sys.stderr, flush=True)

    def say(self, text):
        """Prints it on standard output; the line of progress stays below."""
        with self.lock:
            self.clear()
            print(text, flush=True)

    def end(self):
        self.over.set()
        with self.lock:
            self.clear()


def length(seconds):
    whole = round(seconds)
    return f"{whole} s" if whole < 60 else f"{whole // 60} min {whole % 60:02} s" if whole < 3600 else f"{whole // 3600} h {whole // 60 % 60:02} min"
