#!/usr/bin/env python3
"""What runs programs of Windows ends with the program, whose services go on, and takes it along when it is killed.

usage: ends.py EMULATOR...
The last word of EMULATOR... is Wine; a shell stands in for it here.
"""

import subprocess
import sys

SEEN_WITHIN_S = 30
SERVICE = f"sleep {4 * SEEN_WITHIN_S} >/dev/null </dev/null &"  # keeps standard error, as those of Wine


def under(emulator, script):
    line = [*emulator[:-1], "/bin/sh", "-c", script]
    return subprocess.Popen(line, stdin=subprocess.DEVNULL, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)


def check(what, found, expected):
    if found != expected:
        raise SystemExit(f"{what}: {found!r}, not {expected!r}")
    print(f"ok: {what}")


def ended(program):
    try:
        return (*program.communicate(timeout=SEEN_WITHIN_S), program.returncode)
    except subprocess.TimeoutExpired:
        program.kill()
        return None


def main():
    emulator = sys.argv[1:]
    check("its end is seen", ended(under(emulator, f"{SERVICE} echo out; echo wrong >&2; exit 3")), ("out\n", "wrong\n", 3))
    much = "i=0; while [ $i -lt 20000 ]; do echo 0123456789 >&2; i=$((i+1)); done"
    check("all that it wrote is there", ended(under(emulator, f"{SERVICE} {much}")), ("", "0123456789\n" * 20000, 0))
    program = under(emulator, "echo runs; exec sleep 1000")
    program.stdout.readline()
    program.kill()
    check("killed, it takes the program along", ended(program), ("", "", -9))  # which else kept its output


if __name__ == "__main__":
    main()
