#!/usr/bin/env python3
"""Runs the commands of docs/security.md that are marked to be run, and uses what they made with the real programs.

usage: run_security.py ROOT ISE NAME_SERVER INSTANTIATION_SERVER PROGRAM_WITH_THE_TYPE_trouble
"""

import os
import re
import subprocess
import sys
import tempfile
from pathlib import Path

LIMIT_S = 120
BLOCK = re.compile(r"<!-- run -->\n```sh\n(.*?)^```", re.S | re.M)


class Failed(Exception):
    pass


def run(script, folder, ise):
    """The commands of a block, for which `ise` is the one that was built."""
    tools = folder / "tools"
    tools.mkdir(exist_ok=True)
    if not (tools / "ise").exists():
        (tools / "ise").symlink_to(ise)
    env = {**clean(), "PATH": f"{tools}:{os.environ['PATH']}"}
    done = subprocess.run(["bash", "-euo", "pipefail"], input=script, cwd=folder, text=True, capture_output=True, timeout=LIMIT_S, env=env)
    if done.returncode != 0:
        raise Failed(f"the commands ended with {done.returncode}:\n{script}\n{done.stderr}")


class NameServer:
    """A name server with credentials; `at` is where it listens."""

    def __init__(self, program, listen, *options):
        self.process = subprocess.Popen([program, "--fresh", "--listen", listen, *options], stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, env=clean())

    def __enter__(self):
        line = self.process.stdout.readline().split()
        if not line:
            raise Failed(f"the name server did not start: {self.process.stderr.read()}")
        self.at = line[-1]
        return self

    def __exit__(self, *_):
        self.process.terminate()
        self.log = self.process.communicate()[1]


def clean():
    return {name: value for name, value in os.environ.items() if not name.startswith("ISE_")}


def expect(what, holds, found):
    if not holds:
        raise Failed(f"{what}; found:\n{found}")


def started_with_key(folder, names, ise, instantiation_server, program):
    """An instantiation server beyond loopback: only with credentials, which what it starts has too."""
    (folder / "programs").mkdir()
    (folder / "programs" / Path(program).name).symlink_to(program)
    words = [instantiation_server, "--programs", folder / "programs", "--state", folder / "state", "--name", "one", "--name-server", names, "--listen", "tcp://0.0.0.0:0"]
    bare = subprocess.run(words, capture_output=True, text=True, timeout=LIMIT_S, env=clean())
    expect("without credentials it does not listen", bare.returncode == 1 and "nobody may listen on tcp://0.0.0.0:0 without credentials" in bare.stderr, bare.stderr)
    key = ["--key", folder / "system.key"]
    with subprocess.Popen([*words, *key], stdout=subprocess.PIPE, text=True, env=clean()) as server:
        try:
            expect("with the key it does", "serves the programs in" in server.stdout.readline(), "")
            there = [ise, "--name-server", names, "--timeout", "60s", *key]
            told = subprocess.run([*there, "--wait", "describe", "--names", "ise/host/one"], capture_output=True, text=True, timeout=LIMIT_S, env=clean())
            expect("it is found", told.returncode == 0, told.stdout + told.stderr)
            told = subprocess.run([*there, "start", "trouble", "sea/one", "--ready-within", "60s"], capture_output=True, text=True, timeout=LIMIT_S, env=clean())
            expect("what it starts proves the key too", told.returncode == 0, told.stdout + told.stderr)
        finally:
            server.terminate()


def main():
    if len(sys.argv) != 6:
        print("usage: run_security.py ROOT ISE NAME_SERVER INSTANTIATION_SERVER PROGRAM", file=sys.stderr)
        return 2
    root, ise, name_server, instantiation_server, program = sys.argv[1:]
    blocks = BLOCK.findall((Path(root) / "docs" / "security.md").read_text(encoding="utf-8"))
    key, certificates, renewing, revoking = blocks

    with tempfile.TemporaryDirectory() as made:
        folder = Path(made)

        def list_with(at, *options):
            done = subprocess.run([ise, "--name-server", at, "--timeout", "60s", *options, "list"], capture_output=True, text=True, timeout=LIMIT_S, env=clean())
            return done.returncode, done.stdout + done.stderr

        def list_refused(at, *options):
            done = subprocess.run([ise, "--name-server", at, "--timeout", "2s", *options, "list"], capture_output=True, text=True, timeout=LIMIT_S, env=clean())
            return done.returncode, done.stdout + done.stderr

        run(key, folder, ise)
        (folder / "other.key").write_text("x" * 64)
        (folder / "other.key").chmod(0o600)
        with NameServer(name_server, "tcp://127.0.0.1:0", "--key", folder / "system.key") as names:
            code, told = list_with(names.at, "--key", folder / "system.key")
            expect("with the key there is an answer", code == 0, told)
            code, told = list_refused(names.at)
            expect("without the key there is none, and the reason", code == 3 and "a shared key is demanded here" in told, told)
            code, told = list_refused(names.at, "--key", folder / "other.key")
            expect("with another key there is none, and the reason", code == 3 and "the shared key there is another one" in told, told)
            (folder / "other.key").chmod(0o644)
            code, told = list_refused(names.at, "--key", folder / "other.key")
            expect("a key that others can read is not used", code != 0 and "chmod 600" in told, told)
            started_with_key(folder, names.at, ise, instantiation_server, program)
        expect("the name server says who was refused", "a shared key is demanded here" in names.log, names.log)

        run(certificates + renewing, folder, ise)
        with NameServer(name_server, "tls://127.0.0.1:0", "--tls", folder / "shore") as names:
            code, told = list_with(names.at, "--tls", folder / "laptop")
            expect("with a certificate there is an answer", code == 0, told)
            code, told = list_refused(names.at)
            expect("without one there is none, and the reason", code == 3 and "takes a certificate of this side" in told, told)
        run(revoking, folder, ise)
        with NameServer(name_server, "tls://127.0.0.1:0", "--tls", folder / "shore") as names:
            code, told = list_with(names.at, "--tls", folder / "boat")
            expect("the boat's certificate is good", code == 0, told)
            code, told = list_refused(names.at, "--tls", folder / "laptop")
            expect("the laptop's was revoked", code == 3 and "it was revoked" in told, told)
            # With -ign_eof it stays until the server closes, whose alert comes behind the handshake.
            bare = subprocess.run(["openssl", "s_client", "-ign_eof", "-connect", names.at.removeprefix("tls://"), "-tls1_3", "-CAfile", folder / "shore" / "ca.pem"],
                                  stdin=subprocess.DEVNULL, capture_output=True, text=True, timeout=LIMIT_S, check=False)
            expect("who shows no certificate is told so", "certificate required" in bare.stderr.lower(), bare.stderr)
            old = subprocess.run(["openssl", "s_client", "-connect", names.at.removeprefix("tls://"), "-tls1_2"],
                                 stdin=subprocess.DEVNULL, capture_output=True, text=True, timeout=LIMIT_S, check=False)
            expect("TLS 1.2 is not spoken", old.returncode != 0 and "protocol version" in old.stderr.lower(), old.stderr)
        expect("the name server says who showed none", "it showed no certificate" in names.log, names.log)
        expect("and whose was revoked", "CN = laptop) was revoked" in names.log, names.log)
    return 0


if __name__ == "__main__":
    try:
        sys.exit(main())
    except Failed as why:
        sys.exit(f"run_security.py: {why}")
