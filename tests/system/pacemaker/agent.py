#!/usr/bin/env python3
"""Whether ocf-tester passes the resource agent of apps/pacemaker, and what the agent says of a component that was killed and of a host
without instantiation server. 77: resource-agents is not installed.

usage: agent.py AGENT ISE NAME_SERVER INSTANTIATION_SERVER TROUBLE
"""

import json
import os
import shutil
import signal
import subprocess
import sys
import tempfile
from pathlib import Path

LIMIT_S = 120
SKIPPED = 77
SUCCESS, GENERIC, CONFIGURED, NOT_RUNNING = 0, 1, 6, 7
AGENT, ISE, NAME_SERVER, SERVER, TROUBLE = "", "", "", "", ""
PATH = "sea/trouble"


class Failed(Exception):
    pass


def expect(what, found, wanted):
    if found != wanted:
        raise Failed(f"{what}: {found}, not {wanted}")


def run(*words, **more):
    return subprocess.run([str(word) for word in words], capture_output=True, text=True, timeout=LIMIT_S, check=False, **more)


def start(folder, name, *words):
    """A program that goes on; the first line that it prints tells where it listens."""
    with (folder / f"{name}.log").open("w") as log:
        process = subprocess.Popen([str(word) for word in words], cwd=folder, stdout=subprocess.PIPE, stderr=log, text=True)
    return process, process.stdout.readline().strip()


def end(process, sign=signal.SIGTERM):
    if process.poll() is None:
        process.send_signal(sign)
    process.wait(LIMIT_S)
    process.stdout.close()


class Host:
    def __init__(self, folder, names):
        self.folder, self.names = folder, names

    def serve(self):
        process, _ = start(self.folder, "server", SERVER, "--name", "here", "--programs", self.folder / "programs", "--state", self.folder / "state", "--name-server", self.names)
        answer = run(ISE, "--name-server", self.names, "--wait", "--timeout", "60s", "describe", "--names", "ise/host/here")
        expect(f"the instantiation server: {answer.stderr}", answer.returncode, 0)
        return process

    def agent(self, action, **parameters):
        given = {"type": "trouble", "path": PATH, "host": "here", "ise": ISE, "name_server": self.names, "environment_file": "/nonexistent", **parameters}
        words = {f"OCF_RESKEY_{name}": str(value) for name, value in given.items()}
        words |= {"OCF_ROOT": "/usr/lib/ocf", "OCF_RESOURCE_INSTANCE": "trouble", "OCF_RESKEY_CRM_meta_interval": str(parameters.get("CRM_meta_interval", 10000))}
        return run(AGENT, action, env={**os.environ, **words})

    def process_id(self):
        return json.loads(run(ISE, "--name-server", self.names, "ps", PATH, "--json").stdout)[0]["process_id"]


def tester(host):
    parameters = ["-o", "type=trouble", "-o", f"path={PATH}", "-o", "host=here", "-o", f"ise={ISE}", "-o", f"name_server={host.names}"]
    answer = run("ocf-tester", "-n", "trouble", *parameters, AGENT)
    if answer.returncode:
        raise Failed(f"ocf-tester: {answer.stdout}{answer.stderr}")


def killed(host):
    expect("the start", host.agent("start").returncode, SUCCESS)
    expect("the monitor of what runs", host.agent("monitor").returncode, SUCCESS)
    victim = host.process_id()
    if victim <= 1:
        raise Failed(f"its process is {victim}")
    os.kill(victim, signal.SIGKILL)
    answer = host.agent("monitor")
    while answer.returncode == SUCCESS:  # until the instantiation server has seen it
        answer = host.agent("monitor")
    expect(f"the monitor of what was killed: {answer.stderr}", answer.returncode, GENERIC)
    expect("the reason names path, host and state", f"{PATH} on here is failed" in answer.stderr, True)
    expect("the stop of what was killed", host.agent("stop").returncode, SUCCESS)
    expect("the start of what was killed", host.agent("start").returncode, SUCCESS)
    expect("the stop", host.agent("stop").returncode, SUCCESS)
    expect("the monitor of what was stopped", host.agent("monitor").returncode, NOT_RUNNING)


def without_server(host):
    answer = host.agent("monitor")
    expect(f"the monitor without instantiation server: {answer.stderr}", answer.returncode, GENERIC)
    expect("the probe without instantiation server", host.agent("monitor", CRM_meta_interval=0).returncode, NOT_RUNNING)
    answer = host.agent("stop")
    expect(f"the stop without instantiation server: {answer.stderr}", answer.returncode, GENERIC)


def main():
    global AGENT, ISE, NAME_SERVER, SERVER, TROUBLE
    if len(sys.argv) != 6:
        print(__doc__, file=sys.stderr)
        return 2
    AGENT, ISE, NAME_SERVER, SERVER, TROUBLE = sys.argv[1:]
    if not shutil.which("ocf-tester"):
        print("no ocf-tester here (resource-agents)")
        return SKIPPED
    with tempfile.TemporaryDirectory() as made:
        folder = Path(made)
        (folder / "programs").mkdir()
        (folder / "programs" / "trouble").symlink_to(TROUBLE)
        names, listening = start(folder, "names", NAME_SERVER, "--listen", "tcp://127.0.0.1:0", "--fresh")
        host = Host(folder, listening.split()[-1])
        server = host.serve()
        try:
            tester(host)
            killed(host)
            expect("a path that is none", host.agent("validate-all", path="sea/$(id)").returncode, CONFIGURED)
            end(server)
            without_server(host)
        except Failed as why:
            print(why, file=sys.stderr)
            return 1
        finally:
            end(server)
            end(names)
    return 0


if __name__ == "__main__":
    sys.exit(main())
