#!/usr/bin/env python3
"""The comment of every public asynchronous function says what its callers must know.

usage: async_docs.py ROOT
Looked at: functions that return a task and that programs can call, in the installed headers of ise/. The comment above one
(or behind it: ///<) has to
  describe it, or point to another such function of the header (`name`, "the same");
  say what cancellation does ("Cancellation: …");
  say how it fails, where it returns a result or a pair with an error;
  name each number among its parameters, unless that has a unit or "count" in its own name;
  say how long what it is given by reference must live, for it suspends.
"""

import re
import sys
from pathlib import Path

from cpp_tokens import files_below, read

NOT_INSTALLED = ("ise/database/", "ise/deployment/", "ise/instantiation/")
NUMBERS = {"int", "unsigned", "long", "short", "float", "double", "size_t", "ssize_t", "int32_t", "uint8_t", "uint16_t", "uint32_t", "uint64_t", "int64_t"}
WITH_UNIT = re.compile(r"(_(s|ms|us|ns|m|mps|hz|deg|rad|bytes|pct|percent)|count|port|number|id|bytes)$")
BORROWED = {"string_view", "bytes_view", "span"}
CONSTANTS = {"Contract"}  # services are constants of programs
HEAD_WORDS = {"virtual", "static", "inline", "constexpr", "explicit", "friend", "ise", "::", "typename", "asio"}


class Function:
    def __init__(self, name, line, comment, result, parameters):
        self.name, self.line, self.comment, self.result, self.parameters = name, line, comment, result, parameters


def closing(tokens, at):
    """Behind the `>` that belongs to the `<` at `at`."""
    level = 0
    while at < len(tokens):
        text = tokens[at].text
        if text in "([{" and tokens[at].match > at:
            at = tokens[at].match
        elif text == "<":
            level += 1
        elif text == ">":
            level -= 1
            if level == 0:
                return at + 1
        elif text in ";":
            return at
        at += 1
    return at


def declarations(tokens, begin, end, public):
    """(first token, one behind the last) of each public declaration at the level of namespaces and classes."""
    at, first, access = begin, begin, public
    while at < end:
        text = tokens[at].text
        if text in ("public", "protected", "private") and at + 1 < end and tokens[at + 1].text == ":":
            access = text == "public"
            at += 2
            first = at
        elif text == ";":
            if access:
                yield first, at
            at += 1
            first = at
        elif text == "{":
            head = [token.text for token in tokens[first:at]]
            last = tokens[at].match if tokens[at].match > at else end
            depth = 0  # a word between the brackets of a template head is no class
            kind = None
            for word in head:
                depth += {"<": 1, ">": -1}.get(word, 0)
                if depth == 0 and word in ("namespace", "class", "struct", "union", "enum"):
                    kind = word
                    break
                if word == "(":
                    break
            inner = None
            if kind in ("class", "struct") and "::" in head[head.index(kind):][: head.index(":") if ":" in head else None]:
                pass  # a class of another class: whether it is public is said there
            elif kind == "namespace" and "detail" not in head and len(head) > 1:
                inner = True
            elif kind in ("class", "struct") and access:
                inner = kind == "struct"
            if inner is not None:
                yield from declarations(tokens, at + 1, last, inner)
            elif kind is None and access:
                yield first, at
            at = last + 1
            if at < end and tokens[at].text == ";":
                at += 1
            first = at
        elif text == "(" and tokens[at].match > at:
            at = tokens[at].match + 1
        else:
            at += 1


def function_of(source, first, last):
    """The asynchronous function of a declaration, or nothing."""
    tokens, at = source.tokens, first
    start = first
    if at < last and tokens[at].text == "template":
        at = closing(tokens, at + 1)
        while at < last and tokens[at].text == "requires":  # up to the type that is returned
            at += 1
            while at < last and tokens[at].text != "task":
                at = tokens[at].match + 1 if tokens[at].text == "(" and tokens[at].match > at else at + 1
    while at < last and (tokens[at].text in HEAD_WORDS or tokens[at].text == "["):
        at = tokens[at].match + 1 if tokens[at].text == "[" else at + 1
    if at + 1 >= last or tokens[at].text not in ("task", "awaitable") or tokens[at + 1].text != "<":
        return None
    behind = closing(tokens, at + 1)
    result = " ".join(token.text for token in tokens[at:behind])
    if behind + 1 >= last or tokens[behind].kind != "word" or tokens[behind + 1].text != "(":
        return None
    opening = behind + 1
    parameters, begin, level = [], opening + 1, 0
    for here in range(opening + 1, tokens[opening].match + 1):
        level += {"<": 1, ">": -1}.get(tokens[here].text, 0)
        if (tokens[here].text == "," and level == 0) or here == tokens[opening].match:
            if words := [token.text for token in tokens[begin:here]]:
                parameters.append(words[: words.index("=")] if "=" in words else words)
            begin = here + 1
    if "override" in [token.text for token in tokens[tokens[opening].match : last]]:
        return None  # said where it is declared first
    comment, line = [], tokens[start].line - 1
    while line in source.comments and not any(token.line == line for token in tokens[max(0, start - 1) : start]):
        comment.insert(0, source.comments[line])
        line -= 1
    closing_line = tokens[min(last, len(tokens) - 1)].line
    comment += [source.comments[each] for each in range(tokens[start].line, closing_line + 1) if each in source.comments]
    text = " ".join(comment).replace("///", " ").replace("/ ", " ")
    return Function(tokens[behind].text, tokens[start].line, re.sub(r"\s+", " ", text).strip(" /<"), result, parameters)


def missing(function, names):
    """What the comment does not say."""
    said = function.comment
    if len(re.findall(r"\w+", said)) < 2:
        return ["a comment"]
    referred = any(f"`{name}" in said for name in names if name != function.name)
    if re.match(r"(?i)(the same|as above|see)\b", said) and ("cancel" in said.lower() or referred or len(said) < 60):
        return []
    lacks = []
    if not re.search(r"(?i)cancel", said):
        lacks.append("what cancellation does")
    can_fail = re.search(r"result <|error_code|failure", function.result)
    if can_fail and not re.search(r"(?i)errc|error|fail|refus|cancel\w*: as", said):
        lacks.append("how it fails")
    for words in function.parameters:
        name = words[-1] if len(words) > 1 and re.match(r"[A-Za-z_]", words[-1]) else ""
        kinds = {word for word in words[:-1]}
        if kinds & NUMBERS and not {"<"} & kinds and not WITH_UNIT.search(name) and name not in said:
            lacks.append(f"what the number '{name}' counts")
        borrowed = ("&" in kinds or "*" in kinds or kinds & BORROWED) and not kinds & (CONSTANTS | {"&&"})
        if borrowed and name not in ("self", "on", "env") and not re.search(r"(?i)outliv|\blive|until|valid|refer|destroy|copied|as long as", said):
            lacks.append(f"how long '{name}' must live")
    return lacks


def functions(source):
    found = [function_of(source, first, last) for first, last in declarations(source.tokens, 0, len(source.tokens), True)]
    return [each for each in found if each]


def findings(source):
    of_header = functions(source)
    names = {each.name for each in of_header}
    for each in of_header:
        if lacks := missing(each, names):
            yield f"{source.name}:{each.line}: {each.name}() returns a task, and its comment lacks {', '.join(lacks)}"


def main():
    if len(sys.argv) != 2 or not (Path(sys.argv[1]) / "ise").is_dir():
        print("usage: async_docs.py ROOT", file=sys.stderr)
        return 2
    root, found, count = Path(sys.argv[1]), [], 0
    for name in files_below(root / "ise", {".hpp"}):
        path = f"ise/{name}"
        if path.startswith(NOT_INSTALLED) or "/detail/" in path:
            continue
        source = read(root / path, path)
        count += len(functions(source))
        found += findings(source)
    print(*found, f"{count} functions, {len(found)} findings", sep="\n")
    return 1 if found or count == 0 else 0


if __name__ == "__main__":
    sys.exit(main())
