#!/usr/bin/env python3
"""Runs a step of the tutorial beside a name server of its own and compares what it prints with what its page shows.

usage: run_step.py ROOT STEP PROGRAM NAME_SERVER
"""

import os
import subprocess
import sys
from contextlib import ExitStack
from pathlib import Path

from pages import outputs

LIMIT_S = 60


def ended(process):
    process.terminate()
    process.wait()


def main():
    if len(sys.argv) != 5:
        print("usage: run_step.py ROOT STEP PROGRAM NAME_SERVER", file=sys.stderr)
        return 2
    root, step, program, name_server = sys.argv[1:]
    shown = {}
    for page in (Path(root) / "docs" / "tutorial").glob("*.md"):
        shown.update(outputs(page.read_text(encoding="utf-8")))
    if step not in shown:
        print(f"no page of the tutorial shows the output of {step}", file=sys.stderr)
        return 1
    argument, beside, expected = shown[step]
    with ExitStack() as running:
        names = subprocess.Popen([name_server, "--fresh", "--listen", "tcp://127.0.0.1:0"], stdout=subprocess.PIPE, text=True)
        running.callback(ended, names)
        first = names.stdout.readline().split()
        if not first:
            print("the name server did not start", file=sys.stderr)
            return 1
        here = {**os.environ, "ISE_NAME_SERVER": first[-1]}
        if beside:
            running.callback(ended, subprocess.Popen([program, beside], env=here))
        try:
            done = subprocess.run([program, *filter(None, [argument])], env=here, stdout=subprocess.PIPE, text=True, timeout=LIMIT_S)
        except subprocess.TimeoutExpired as late:
            print(f"{step} did not end within {LIMIT_S} s; so far it printed:\n{(late.stdout or b'').decode()}", file=sys.stderr)
            return 1
    if done.returncode != 0:
        print(f"{step} ended with exit code {done.returncode}", file=sys.stderr)
    if done.stdout != expected:
        print(f"the page shows\n{expected}\nand {step} printed\n{done.stdout}", file=sys.stderr)
    return 0 if done.returncode == 0 and done.stdout == expected else 1


if __name__ == "__main__":
    sys.exit(main())
