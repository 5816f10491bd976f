#!/usr/bin/env python3
"""No line of the tree names a package registry's host or a folder of the machine that it was written on.

usage: machine_names.py ROOT
"""

import re
import subprocess
import sys
from pathlib import Path

from cpp_tokens import _SKIPPED

PATTERNS = [
    (re.compile(r"registry\.(?:npmjs|yarnpkg|npmmirror)\.\w+|npm\.pkg\.github|(?<![\w.])pypi\.(?:org|python)|pythonhosted\.org|"
                r"(?:proxy|sum)\.golang\.org|(?:static|index)\.crates\.io|repo1?\.maven\.\w+|rubygems\.org|"
                r"\b(?:artifactory|nexus|verdaccio|devpi)\b[\w.-]*[:/]|(?:deb|security|snapshot|ftp\.\w+)\.debian\.org"),
     "names the host of a package registry"),
    (re.compile(r"(?<![\w./})$*>-])/(?:work|root|workspace|home/[a-z_][\w-]*|Users/\w+|builds)(?:/|(?=[\s\"'`),;]|$))"),
     "names a folder of one machine"),
]


def findings_in(text):
    for number, line in enumerate(text.split("\n"), 1):
        for pattern, why in PATTERNS:
            if match := pattern.search(line):
                yield number, f"`{match[0]}` {why}"


def files_of(root):
    """What git knows or would add; without git, everything but what is built."""
    try:
        listed = subprocess.run(["git", "-C", str(root), "ls-files", "-z", "--cached", "--others", "--exclude-standard"],
                                capture_output=True, check=True).stdout.decode("utf-8", "replace")
        return sorted(Path(name) for name in listed.split("\0") if name)
    except (OSError, subprocess.CalledProcessError):
        return sorted(path.relative_to(root) for path in root.rglob("*")
                      if path.is_file() and not _SKIPPED & set(path.relative_to(root).parts))


def main():
    if len(sys.argv) != 2 or not Path(sys.argv[1]).is_dir():
        print("usage: machine_names.py ROOT", file=sys.stderr)
        return 2
    root, seen, count = Path(sys.argv[1]), 0, 0
    for path in files_of(root):
        if not (root / path).is_file() or (root / path).is_symlink() or path.as_posix() == "tests/lint/tree_selftest.py":
            continue
        raw = (root / path).read_bytes()
        if b"\0" in raw[:8192]:
            continue
        seen += 1
        for line, text in findings_in(raw.decode("utf-8", "replace")):
            print(f"{path}:{line}: {text}")
            count += 1
    print(f"{seen} files, {count} findings")
    return 1 if count or not seen else 0


if __name__ == "__main__":
    sys.exit(main())
