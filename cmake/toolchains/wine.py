#!/usr/bin/env python3
"""Runs a program of Windows under Wine and ends with its exit code.

usage: wine.py WINE PROGRAM [ARGUMENT...]

Wine's server and services inherit standard error from the first program and keep it open as long as any program runs under
Wine. CMake and ctest wait for its end: the first of several programs at once would not be seen to end. The program therefore
writes into a pipe of its own, which is passed on until the program has ended. Killed, this takes the program with it.
"""

import ctypes
import os
import select
import signal
import subprocess
import sys

PR_SET_PDEATHSIG = 1


def end_with_parent():
    ctypes.CDLL(None).prctl(PR_SET_PDEATHSIG, signal.SIGKILL)


def pass_on(reader, program):
    ended = os.pidfd_open(program.pid)
    while True:
        ready, _, _ = select.select([reader, ended], [], [])
        if reader in ready:
            text = os.read(reader, 65536)
            if not text:
                return
            sys.stderr.buffer.write(text)
            sys.stderr.buffer.flush()
        else:
            return  # it has ended, and everything that it wrote was read


def main():
    reader, writer = os.pipe()
    environment = {"WINEDEBUG": "-all", **os.environ}
    program = subprocess.Popen(sys.argv[1:], stderr=writer, env=environment, preexec_fn=end_with_parent)
    os.close(writer)
    pass_on(reader, program)
    code = program.wait()
    return code if code >= 0 else 128 - code


if __name__ == "__main__":
    sys.exit(main())
