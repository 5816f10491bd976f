#!/usr/bin/env python3
"""Runs the commands of docs/access.md that bring up A-Tirma under its policy, and looks at what came of them.

usage: run_atirma.py ROOT PROGRAM... (ise, ise_name_server, ise_instantiation_server, atirma)
"""

import json
import os
import re
import signal
import socket
import subprocess
import sys
import tempfile
import time
import urllib.request
from pathlib import Path

LIMIT_S = 540
MOST_COMMANDS = 6
BLOCK = re.compile(r"<!-- run: atirma -->\n```sh\n(.*?)^```", re.S | re.M)


class Failed(Exception):
    pass


def expect(what, holds, found=""):
    if not holds:
        raise Failed(f"{what}; found:\n{found}")


def free_ports(count):
    """Ports on which nobody listens; all are open at once, so that no two are the same."""
    held = [socket.socket() for _ in range(count)]
    try:
        for one in held:
            one.bind(("127.0.0.1", 0))
        return [one.getsockname()[1] for one in held]
    finally:
        for one in held:
            one.close()


def audit(folder):
    lines = [json.loads(line) for line in (folder / "sea/audit.jsonl").read_text(encoding="utf-8").splitlines()]
    expect("the audit log has what was named and started", any(one["what"].startswith("start ") for one in lines), lines)
    return [one for one in lines if one["verdict"] != "allowed"]


def main():
    if len(sys.argv) != 6:
        print("usage: run_atirma.py ROOT ISE NAME_SERVER INSTANTIATION_SERVER ATIRMA", file=sys.stderr)
        return 2
    root, *programs = sys.argv[1:]
    (script,) = BLOCK.findall((Path(root) / "docs" / "access.md").read_text(encoding="utf-8"))
    commands = script.splitlines()
    expect(f"at most {MOST_COMMANDS} commands", len(commands) <= MOST_COMMANDS, script)
    names, page, gprs, carrier, hook, gateway = free_ports(6)
    script = script.replace(":7400", f":{names}")
    ports = f"--set page={page} --set gprs={gprs} --set carrier={carrier} --set hook={hook} --set gateway={gateway}"
    expect("the file's ports can be chosen", script.count("--set protocol=tls") == 1, script)
    script = script.replace("--set protocol=tls", f"--set protocol=tls {ports}")
    with tempfile.TemporaryDirectory() as made:
        folder = Path(made)
        tools = folder / "tools"
        tools.mkdir()
        for one in programs:
            (tools / Path(one).name).symlink_to(one)
        (folder / "apps").symlink_to(Path(root) / "apps")
        env = {name: value for name, value in os.environ.items() if not name.startswith("ISE_")}
        env["PATH"] = f"{tools}:{env['PATH']}"
        # The servers go on in the background; the process that stays is the one whose group is ended.
        began = time.monotonic()
        with subprocess.Popen(["bash", "-euo", "pipefail"], stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=open(folder / "errors", "wb"), cwd=folder, text=True, env=env, start_new_session=True) as shell:
            try:
                shell.stdin.write("trap 'echo a command failed' ERR\n" + script + "echo every command is done\nread -r stay || true\n")
                shell.stdin.flush()
                told = []
                for line in shell.stdout:
                    told.append(line)
                    if line in ("every command is done\n", "a command failed\n"):
                        break
                if told[-1:] != ["every command is done\n"]:  # the servers hold the pipe open: its end says nothing
                    raise Failed(f"a command failed:\n{''.join(told)}\n{(folder / 'errors').read_text()}")
                print(f"{len(commands)} commands, {time.monotonic() - began:.1f} s")
                look(folder, env, names, page)
            finally:
                if shell.pid > 1:
                    os.killpg(shell.pid, signal.SIGTERM)
    return 0


def look(folder, env, names, page):
    def ise(*words):
        done = subprocess.run(["ise", "--name-server", f"tls://127.0.0.1:{names}", "--tls", folder / "sea/keys/ana", "--timeout", "60s", *words], capture_output=True, text=True, timeout=LIMIT_S, env=env, check=False)
        expect(f"ise {' '.join(words)} succeeds", done.returncode == 0, done.stdout + done.stderr)
        return done.stdout

    running = json.loads(ise("ps", "--json"))
    expect("all components are ready", len(running) == 12 and all(one["state"] == "ready" for one in running), running)
    listed = json.loads(ise("list", "--json"))
    expect("and all talk over TLS", all(at.startswith("tls://") for one in listed for at in one["endpoints"]), listed)
    policies = json.loads(ise("access", "list", "--json"))
    expect("under one policy", not any(one["differs"] or one["problem"] for one in policies), policies)
    # The page has the boat: what it shows came by the policy.
    ise("echo", "atirma/communication", "telemetry", "-n", "3")
    until = time.monotonic() + LIMIT_S / 3
    while True:
        with urllib.request.urlopen(f"http://127.0.0.1:{page}/track.json", timeout=60) as answer:
            shown = answer.read().decode()
        if "latitude" in shown or time.monotonic() > until:
            break
        time.sleep(0.2)  # it is asked until then
    expect("the page shows where the boat was", "latitude" in shown, shown[:500])
    refused = audit(folder)
    expect("nothing was refused", not refused, "\n".join(map(json.dumps, refused)))


if __name__ == "__main__":
    try:
        sys.exit(main())
    except Failed as why:
        sys.exit(f"run_atirma.py: {why}")
