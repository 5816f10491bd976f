#!/usr/bin/env python3
"""Name server, component and `ise` of Windows talk to one another, and with those of Linux, over tcp.

usage: talk.py --windows FOLDER --linux FOLDER EMULATOR...
FOLDER has ise, ise_name_server and wire_party; where that of Linux has none, this part is left out, and said so.
EMULATOR...: how a program of Windows is run.
"""

import argparse
import contextlib
import json
import os
import queue
import subprocess
import sys
import threading
from pathlib import Path

PATIENCE_S = 120  # for a machine that is busy; what hangs fails then


class Programs:
    def __init__(self, folder, prefix, suffix):
        self.folder, self.prefix, self.suffix = Path(folder), prefix, suffix

    def there(self):
        return all((self.folder / (name + self.suffix)).is_file() for name in ("ise", "ise_name_server", "wire_party"))

    def line(self, program, *arguments):
        return [*self.prefix, str(self.folder / (program + self.suffix)), *arguments]


@contextlib.contextmanager
def running(line, environment):
    """A program and its first line of output."""
    process = subprocess.Popen(line, env=environment, stdout=subprocess.PIPE, stdin=subprocess.PIPE, text=True)
    lines = queue.Queue()

    def read():
        for one in process.stdout:
            lines.put(one.strip())
        lines.put(None)

    threading.Thread(target=read, daemon=True).start()
    try:
        first = lines.get(timeout=PATIENCE_S)
        if first is None:
            raise SystemExit(f"{line}: ended without a line")
        yield first
    finally:
        process.kill()
        process.wait()


def answer(line, environment):
    done = subprocess.run(line, env=environment, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, timeout=PATIENCE_S)
    if done.returncode != 0:
        raise SystemExit(f"{line}: exit code {done.returncode}\n{done.stdout}{done.stderr}")
    return done.stdout


def check(what, found, expected):
    if expected not in found:
        raise SystemExit(f"{what}: no {expected!r} in\n{found}")
    print(f"ok: {what}")


def story(names, provider, clients):
    """`names` has the name server, `provider` a component, each of `clients` a command line."""
    environment = dict(os.environ)
    with running(names.line("ise_name_server", "--listen", "tcp://127.0.0.1:0", "--fresh", "--state", "none"), environment) as said:
        environment["ISE_NAME_SERVER"] = said.split()[-1]
        # On every interface: two systems are two hosts to ISE, even where they share a loopback.
        with running(provider.line("wire_party", "provide", "tcp://0.0.0.0:0", "test/party"), environment):
            for client in clients:
                who = "windows" if client.suffix else "linux"
                request = json.dumps({"said": "Gáldar"}, ensure_ascii=True)
                called = answer(client.line("ise", "call", "--wait", "--json", "test/party", "helm", request), environment)
                check(f"{who}: call", json.dumps(json.loads(called), ensure_ascii=False), "Gáldar")
                check(f"{who}: list", answer(client.line("ise", "list"), environment), "test/party")
                check(f"{who}: refused call", refusal(client, environment), "boats float")
                check(f"{who}: echo", answer(client.line("ise", "echo", "--wait", "--json", "-n", "1", "test/party", "weather"), environment), "{")


def refusal(client, environment):
    line = client.line("ise", "call", "test/party", "helm", '{"said":"sink"}')
    done = subprocess.run(line, env=environment, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, timeout=PATIENCE_S)
    if done.returncode != 1:
        raise SystemExit(f"{line}: exit code {done.returncode}, not 1\n{done.stdout}{done.stderr}")
    return done.stderr


def main():
    parser = argparse.ArgumentParser()
    parser.add_argument("--windows", required=True)
    parser.add_argument("--linux", required=True)
    parser.add_argument("emulator", nargs="+")
    given = parser.parse_args()
    windows, linux = Programs(given.windows, given.emulator, ".exe"), Programs(given.linux, [], "")
    if not windows.there():
        sys.exit(f"talk.py: not all programs are in {given.windows}")
    if not linux.there():
        print(f"LEFT OUT: the same with programs of Linux, which are not in {given.linux}")
        return story(windows, windows, [windows])
    story(windows, windows, [windows, linux])
    story(windows, linux, [windows])
    story(linux, windows, [linux, windows])


if __name__ == "__main__":
    main()
