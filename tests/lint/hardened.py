#!/usr/bin/env python3
"""The programs are hardened: position independent, relocations read-only and bound at once, stack protector, checked
library functions, a stack that is not executable.

usage: hardened.py [--fortified] [--commands=compile_commands.json] PROGRAM...
--fortified: the build optimizes, so calls of the C library are checked (_FORTIFY_SOURCE).
--commands: what leaves no trace in every program is looked for in how its sources are compiled.
"""

import json
import platform
import shlex
import subprocess
import sys
from pathlib import Path

COMPILED_WITH = ["-fstack-clash-protection", "-D_GLIBCXX_ASSERTIONS"]
if platform.machine() in ("x86_64", "i686"):
    COMPILED_WITH.append("-fcf-protection")


def readelf(*words):
    return subprocess.run(["readelf", "--wide", *words], capture_output=True, text=True, check=True).stdout


def findings_in(program, fortified):
    header, segments, dynamic, symbols = (readelf(flag, program) for flag in ("-h", "-l", "-d", "--dyn-syms"))
    if "DYN (" not in header:
        yield "is not position independent (-pie)"
    if "GNU_RELRO" not in segments:
        yield "its relocations stay writable (-Wl,-z,relro)"
    if "BIND_NOW" not in dynamic and "NOW" not in dynamic:
        yield "its functions are bound late, so that their table stays writable (-Wl,-z,now)"
    stack = [line for line in segments.splitlines() if "GNU_STACK" in line]
    if not stack or "E" in stack[0].split()[-2]:
        yield "its stack is executable"
    if "__stack_chk_fail" not in symbols:
        yield "has no stack protector (-fstack-protector-strong)"
    if fortified and "_chk@" not in symbols.replace("__stack_chk_fail@", ""):
        yield "calls no checked function of the C library (-D_FORTIFY_SOURCE=2)"


def findings_in_commands(file):
    """One line for each option that a source is compiled without."""
    for option in COMPILED_WITH:
        bare = [entry["file"] for entry in json.loads(Path(file).read_text()) if option not in shlex.split(entry["command"])]
        if bare:
            yield f"{len(bare)} sources are compiled without {option}, the first is {bare[0]}"


def main():
    words = sys.argv[1:]
    commands = [word.split("=", 1)[1] for word in words if word.startswith("--commands=")]
    fortified = "--fortified" in words
    programs = [word for word in words if not word.startswith("--")]
    if not programs:
        print("usage: hardened.py [--fortified] [--commands=compile_commands.json] PROGRAM...", file=sys.stderr)
        return 2
    count = 0
    for program in programs:
        for text in findings_in(program, fortified):
            print(f"{program}: {text}")
            count += 1
    for file in commands:
        for text in findings_in_commands(file):
            print(text)
            count += 1
    print(f"{len(programs)} programs, {count} findings")
    return 1 if count else 0


sys.exit(main())
