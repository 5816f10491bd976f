#!/usr/bin/env python3
"""What `ise access learn` writes of a running system, and that the system goes on under it and does nothing more.

usage: learning.py ISE NAME_SERVER CREW
Each program has a certificate with an identity of its own, and sessions go over tls.
"""

import os
import signal
import subprocess
import sys
import tempfile
import tomllib
from pathlib import Path

LIMIT_S = 120
ISE, NAME_SERVER, CREW = "", "", ""


class Failed(Exception):
    pass


def expect(what, holds, found=""):
    if not holds:
        raise Failed(f"{what}; found:\n{found}")


def environment(**more):
    made = {name: value for name, value in os.environ.items() if not name.startswith("ISE_")}
    made.update(more)
    return made


def ise(folder, *words, at=None):
    address = ["--name-server", at, "--tls", folder / "operator"] if at else []
    return subprocess.run([str(word) for word in (ISE, *address, *words)], cwd=folder, capture_output=True, text=True, timeout=LIMIT_S, env=environment(), check=False)


class Program:
    """Runs until the end of the block. Lines of its standard output are read one by one; its log goes to a file."""

    def __init__(self, folder, name, words, **variables):
        self.log = folder / f"{name}.log"
        with self.log.open("w") as log:
            self.process = subprocess.Popen([str(word) for word in words], cwd=folder, stdout=subprocess.PIPE, stderr=log, text=True, env=environment(**variables))

    def line(self):
        while True:
            line = self.process.stdout.readline()
            if not line:
                raise Failed(f"it ended: {self.log.read_text()}")
            if not line.startswith("started:"):
                return line.strip()

    def __enter__(self):
        return self

    def __exit__(self, *_):
        self.process.kill()
        self.process.communicate()


class System:
    """A name server, a boat and its watch; all under `policy` if there is one."""

    def __init__(self, folder, policy=None, **variables):
        if policy:
            variables.update(ISE_ACCESS=str(policy), ISE_AUDIT=str(folder / "audit.jsonl"))
        self.names = Program(folder, "names", [NAME_SERVER, "--fresh", "--listen", "tls://127.0.0.1:0", "--tls", folder / "shore"], **variables)
        self.at = self.names.line().split()[-1]
        variables.update(ISE_NAME_SERVER=self.at)
        run = lambda name: Program(folder, name, [CREW, "run", name, "--listen=tls://127.0.0.1:0", f"--tls={folder / name}"], **variables)
        self.boat = run("boat")
        self.watch = run("watch")

    def __enter__(self):
        return self

    def __exit__(self, *_):
        for one in (self.watch, self.boat, self.names):
            one.__exit__()


def prepare(folder):
    ise(folder, "keys", "ca", "robots")
    for name in ("shore", "boat", "watch", "operator"):
        ise(folder, "keys", "request", f"ise://robots/{name}", "--host", "127.0.0.1")
    done = ise(folder, "keys", "issue", "shore", "boat", "watch", "operator")
    expect("there are certificates", done.returncode == 0, done.stderr)


def learned(folder):
    file = folder / "access.toml"
    with System(folder) as all_of_it:
        told = all_of_it.watch.line()
        expect("the watch is kept without a policy", told == "kept", told)
        file.write_text("mine")
        done = ise(folder, "access", "learn", "--for", "10m", "--out", file, at=all_of_it.at)
        expect("a file that is there is refused at once", done.returncode == 1 and "is there already" in done.stderr and file.read_text() == "mine", done.stderr)
        done = ise(folder, "access", "learn", "--for", "1500ms", "--out", file, "--force", at=all_of_it.at)
        expect("it is learned", done.returncode == 0 and "3 rules" in done.stdout, done.stdout + done.stderr)
        ended = Program(folder, "ended", [ISE, "--name-server", all_of_it.at, "--tls", folder / "operator", "access", "learn", "--out", folder / "early.toml"])
        with ended:
            while "watching" not in ended.log.read_text():  # the limit of the test ends this
                expect("it watches", ended.process.poll() is None, ended.log.read_text())
            ended.process.send_signal(signal.SIGINT)
            told = ended.process.stdout.read()
            expect("Ctrl-C ends it, and the policy is written", ended.process.wait(LIMIT_S) == 0 and "3 rules" in told, told + ended.log.read_text())
    text = file.read_text()
    body = lambda of: of[of.index("version") :]
    expect("what is seen the same is written the same", body(text) == body((folder / "early.toml").read_text()), (folder / "early.toml").read_text())
    rules = {one.pop("who"): one for one in tomllib.loads(text)["allow"]}
    wanted = {
        "ise://robots/boat": {"name": ["robots/boat"]},
        "ise://robots/shore": {"name": ["ise/name_server"]},
        "ise://robots/watch": {"name": ["robots/watch"], "call": ["robots/boat:helm"], "subscribe": ["robots/boat:position"]},
    }
    expect("it allows what is used, and nothing else", rules == wanted, text)
    expect("and says where it comes from", '"robots/boat:helm", # by robots/watch' in text, text)
    done = ise(folder, "access", "check", file)
    expect("the checker has nothing against it", done.returncode == 0 and done.stdout.count("\n") == 1, done.stdout + done.stderr)
    return file


def obeyed(folder, file):
    with System(folder, file, CREW_SCUTTLES="yes") as all_of_it:
        for _ in range(3):
            expect("what was seen goes on", all_of_it.watch.line() == "kept", all_of_it.watch.log.read_text())
            told = all_of_it.watch.line()
            expect("what was not seen is refused", "ise://robots/watch may not call 'scuttle' of robots/boat" in told, told)
        done = ise(folder, "--timeout", "5s", "call", "robots/boat", "helm", '{"heading_deg": 1}', at=all_of_it.at)
        expect("and so is somebody else", done.returncode != 0 and "ise://robots/operator may not" in done.stderr, done.stdout + done.stderr)


def nothing_to_learn(folder):
    with Program(folder, "alone", [NAME_SERVER, "--fresh", "--listen", "tcp://127.0.0.1:0"]) as alone:
        at = alone.line().split()[-1]
        done = ise(folder, "--name-server", at, "access", "learn", "--for", "1ms", "--out", "none.toml")
        expect("nobody is there: the name server alone is a name", done.returncode == 0 and (folder / "none.toml").exists(), done.stderr)
    done = ise(folder, "--name-server", at, "--timeout", "2s", "access", "learn", "--for", "1ms", "--out", "away.toml")
    expect("without a name server it ends with an error, and no file", done.returncode == 3 and not (folder / "away.toml").exists(), done.stderr)
    done = ise(folder, "access", "check", "none.toml", "--out", "y.toml")
    expect("options of learn are of learn", done.returncode == 2 and "are of ise access learn" in done.stderr, done.stderr)


def main():
    global ISE, NAME_SERVER, CREW
    if len(sys.argv) != 4:
        print("usage: learning.py ISE NAME_SERVER CREW", file=sys.stderr)
        return 2
    ISE, NAME_SERVER, CREW = (str(Path(one).resolve()) for one in sys.argv[1:])
    with tempfile.TemporaryDirectory() as made:
        folder = Path(made)
        prepare(folder)
        obeyed(folder, learned(folder))
        nothing_to_learn(folder)
    return 0


if __name__ == "__main__":
    try:
        sys.exit(main())
    except Failed as why:
        sys.exit(f"learning.py: {why}")
