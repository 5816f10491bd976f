#!/usr/bin/env python3
"""Writes the C++ blocks of README.md and docs/*.md out as sources, for the build to compile.

usage: document_code.py ROOT OUTPUT_DIR
Prints the written files, one a line. A block is a translation unit of its own, compiled as it is printed.
On the line before a block: "<!-- compile: continue -->" appends it to the block before,
"<!-- compile: skip: why -->" leaves it out; the reason is required.
"""

import re
import sys
from pathlib import Path

from cpp_tokens import markdown_blocks

MARK = re.compile(r"<!--\s*compile:\s*(\w+):?\s*(.*?)\s*-->\s*$")


def units_of(document, name):
    """[text of a translation unit]; raises ValueError for a mark that makes no sense."""
    units = []
    for line, before, code in markdown_blocks(document):
        piece = f'#line {line} "{name}"\n{code}'
        mark = MARK.search(before)
        what = mark[1] if mark else "alone"
        if what == "skip":
            if not mark[2]:
                raise ValueError(f"{name}:{line}: compile: skip without a reason")
        elif what == "continue":
            if not units:
                raise ValueError(f"{name}:{line}: compile: continue, but there is no block before")
            units[-1] += piece
        elif what == "alone":
            units.append(piece)
        else:
            raise ValueError(f"{name}:{line}: compile: {what} is not known (skip, continue)")
    return units


def main():
    if len(sys.argv) != 3:
        print("usage: document_code.py ROOT OUTPUT_DIR", file=sys.stderr)
        return 2
    root, output = Path(sys.argv[1]), Path(sys.argv[2])
    output.mkdir(parents=True, exist_ok=True)
    written = []
    try:
        for document in [root / "README.md", *sorted((root / "docs").glob("*.md"))]:
            units = units_of(document.read_text(encoding="utf-8"), str(document)) if document.is_file() else []
            for number, text in enumerate(units, 1):
                path = output / f"{document.stem.lower()}_{number}.cpp"
                if not path.is_file() or path.read_text(encoding="utf-8") != text:  # else it would be compiled again
                    path.write_text(text, encoding="utf-8")
                written.append(path)
    except ValueError as wrong:
        print(wrong, file=sys.stderr)
        return 1
    for path in output.glob("*.cpp"):
        if path not in written:
            path.unlink()
    print(*written, sep="\n")
    return 0


if __name__ == "__main__":
    sys.exit(main())
