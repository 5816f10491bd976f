#!/usr/bin/env python3
"""Checks docs/: what a page shows is what is compiled, every step has its output, and links lead to files.

usage: pages.py ROOT
A C++ block whose preceding line is "<!-- compile: skip: shown from FILE -->" (FILE relative to the page) must be lines
of FILE that stand together there; a common indentation may be left out. On the pages of the tutorial each block has
such a mark. "<!-- output of STEP -->" stands before the block with what that program prints.
"""

import re
import sys
import textwrap
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parent.parent / "lint"))
from cpp_tokens import markdown_blocks  # noqa: E402

SHOWN = re.compile(r"<!-- compile: skip: shown from (\S+) -->\s*$")
OUTPUT = re.compile(r"<!-- output of (\w+)(?: (\w+))?(?:, beside (\w+))? -->\n```text\n(.*?)^```", re.S | re.M)
LINK = re.compile(r"(?<!!)\[[^\]]*\]\(([^)\s]+)\)")
FENCE = re.compile(r"^```.*?^```", re.S | re.M)


def outputs(text):
    """{step: (argument or None, argument of the program beside it or None, what is printed)} of a page."""
    return {step: (argument, beside, shown) for step, argument, beside, shown in OUTPUT.findall(text)}


def holds(source, code):
    """Whether the lines of code stand together in source, at one indentation."""
    wanted = textwrap.dedent(code).strip("\n").splitlines()
    lines = source.splitlines()
    for start in range(len(lines) - len(wanted) + 1):
        piece = textwrap.dedent("\n".join(lines[start : start + len(wanted)])).splitlines()
        if [line.rstrip() for line in piece] == [line.rstrip() for line in wanted]:
            return True
    return False


def complaints(name, text, file_of, must_be_shown):
    """What is wrong with a page; file_of(relative path) is a file's text, "" for a folder, or None."""
    wrong = []
    for line, before, code in markdown_blocks(text):
        mark = SHOWN.search(before)
        if not mark:
            if must_be_shown:
                wrong.append(f"{name}:{line}: say above this block from which file it is shown")
            continue
        source = file_of(mark[1])
        if source is None:
            wrong.append(f"{name}:{line}: there is no {mark[1]}")
        elif not holds(source, code):
            wrong.append(f"{name}:{line}: {mark[1]} has no such lines; show what is compiled")
    for target in LINK.findall(FENCE.sub("", text)):
        if re.match(r"[a-z]+:", target) or target.startswith("#"):
            continue
        if file_of(target.split("#")[0]) is None:
            wrong.append(f"{name}: the link to {target} leads nowhere")
    return wrong


def main():
    if len(sys.argv) != 2:
        print("usage: pages.py ROOT", file=sys.stderr)
        return 2
    root = Path(sys.argv[1])
    wrong, shown = [], set()
    for page in [root / "README.md", *sorted((root / "docs").rglob("*.md"))]:

        def file_of(path):
            found = page.parent / path
            if found.is_dir():
                return ""
            return found.read_text(encoding="utf-8", errors="replace") if found.is_file() else None  # or a picture

        text = page.read_text(encoding="utf-8")
        wrong += complaints(str(page.relative_to(root)), text, file_of, page.parent.name == "tutorial")
        shown |= outputs(text).keys()
    for step in sorted((root / "docs" / "tutorial").glob("step*.cpp")):
        if step.stem not in shown:
            wrong.append(f"docs/tutorial: no page shows the output of {step.stem}")
    print(*wrong, sep="\n", end="\n" if wrong else "")
    return 1 if wrong else 0


if __name__ == "__main__":
    sys.exit(main())
