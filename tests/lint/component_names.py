#!/usr/bin/env python3
"""The names that a class derived from ise::component sees are those that its comment and docs/concepts.md list.

usage: component_names.py ROOT
"""

import re
import sys
from pathlib import Path

from async_docs import closing
from cpp_tokens import read


def class_named(tokens, name):
    """The brackets of its body."""
    for i, token in enumerate(tokens[:-1]):
        if token.text == "class" and tokens[i + 1].text == name:
            at = next(n for n in range(i, len(tokens)) if tokens[n].text in "{;")
            if tokens[at].text == "{":
                return at, tokens[at].match
    return 0, 0


def members(tokens, name):
    """The names of its functions and data, whoever may use them."""
    begin, end = class_named(tokens, name)
    found, at, head = set(), begin + 1, True
    while at < end:
        text = tokens[at].text
        if text == "template":
            at = closing(tokens, at + 1)
            continue
        if text in ("public", "protected", "private") and tokens[at + 1].text == ":":
            at += 2
            head = True
            continue
        if head and (text == "(" or text in ";={") and tokens[at - 1].kind == "word" and at - 1 > begin:
            found.add(tokens[at - 1].text)
            head = False
        if text in "({" and tokens[at].match > at:
            at = tokens[at].match
            if text == "{":
                head = True
        elif text == ";":
            head = True
        at += 1
    return found - {name, "const", "override", "noexcept"}


def listed(text):
    return set(re.findall(r"`(\w+)`", text))


def main():
    if len(sys.argv) != 2 or not (Path(sys.argv[1]) / "ise").is_dir():
        print("usage: component_names.py ROOT", file=sys.stderr)
        return 2
    root = Path(sys.argv[1])
    header = root / "ise/component/component.hpp"
    has = members(read(header).tokens, "component")
    comment = re.search(r"/// Names that a derived class inherits.*?(?=class component )", header.read_text(), re.S)
    table = re.search(r"A class derived from `ise::component` inherits these names.*?\n\n(\|.*?)\n\n", (root / "docs/concepts.md").read_text(), re.S)
    found = []
    for place, text in (("the comment of ise::component", comment and comment[0]), ("docs/concepts.md", table and table[1])):
        found += [f"{place} does not list {name}" for name in sorted(has - listed(text or ""))]
        found += [f"{place} lists {name}, which ise::component does not have" for name in sorted(listed(text or "") - has)]
    print(*found, f"{len(has)} names, {len(found)} findings", sep="\n")
    return 1 if found or not has else 0


if __name__ == "__main__":
    sys.exit(main())
