#!/usr/bin/env python3
"""C++ is formatted by .clang-format, and no line is longer than 120 characters but for a string that cannot be broken.

usage: format.py ROOT
Formatting is compared only where clang-format 14 is installed, since versions differ; elsewhere exit code 77 says so.
"""

import shutil
import subprocess
import sys
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

from cpp_tokens import files_below, tokenize

LONGEST = 120
VERSION = 14
AT_ONCE = 40  # files of one process


def clang_format():
    """The program of that version, or nothing."""
    for name in (f"clang-format-{VERSION}", "clang-format"):
        if program := shutil.which(name):
            said = subprocess.run([program, "--version"], capture_output=True, text=True).stdout
            if f"version {VERSION}." in said:
                return program
    return None


def in_strings(text):
    """The lines on which a string begins, lies or ends."""
    found = set()
    for token in tokenize(text).tokens:
        if token.kind == "string":
            found.update(range(token.line, token.line + token.text.count("\n") + 1))
    return found


def long_lines(name, text):
    long_ones = [n for n, line in enumerate(text.split("\n"), 1) if len(line) > LONGEST]
    allowed = in_strings(text) if long_ones else set()
    return [f"{name}:{n}: longer than {LONGEST} characters" for n in long_ones if n not in allowed]


def unformatted(program, root, names):
    """The first place in each file that clang-format would write otherwise."""
    ran = subprocess.run([program, "--dry-run", "--ferror-limit=1", *map(str, names)], cwd=root, capture_output=True, text=True)
    found = [line.partition(": warning")[0] for line in ran.stderr.splitlines() if "[-Wclang-format-violations]" in line]
    if ran.returncode != 0:
        found.append(ran.stderr.strip())
    return [f"{place}: not as {program} -i writes it" for place in found]


def main():
    if len(sys.argv) != 2 or not (Path(sys.argv[1]) / ".clang-format").is_file():
        print("usage: format.py ROOT", file=sys.stderr)
        return 2
    root = Path(sys.argv[1])
    names = files_below(root, {".cpp", ".hpp"})
    found = [line for name in names for line in long_lines(name, (root / name).read_text(encoding="utf-8", errors="replace"))]
    program = clang_format()
    if program:
        batches = [names[at : at + AT_ONCE] for at in range(0, len(names), AT_ONCE)]
        with ThreadPoolExecutor(2) as pool:
            found += [line for batch in pool.map(lambda some: unformatted(program, root, some), batches) for line in batch]
    print(*found, f"{len(names)} files, {len(found)} findings", sep="\n")
    if found or not names:
        return 1
    if not program:
        print(f"skipped: formatting is compared by clang-format {VERSION}, which is not installed; the lengths of lines hold")
        return 77
    return 0


if __name__ == "__main__":
    sys.exit(main())
