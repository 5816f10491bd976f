"""Tokens of C++ as far as the lints need them: no comments, strings as one token, brackets matched."""

import re
from dataclasses import dataclass, field
from pathlib import Path


@dataclass
class Token:
    kind: str  # word, number, string, sign
    text: str
    line: int
    match: int = -1  # of a bracket: the index of its partner


@dataclass
class Source:
    name: str
    tokens: list = field(default_factory=list)
    comments: dict = field(default_factory=dict)  # line -> the comment's text
    includes: list = field(default_factory=list)  # (line, "<" or '"', path)


_RAW = re.compile(r'(?:u8|u|U|L)?R"([^()\\\s]{0,16})\(')
_STRING = re.compile(r'(?:u8|u|U|L)?"(?:\\.|[^"\\\n])*"', re.S)
_CHAR = re.compile(r"(?:u8|u|U|L)?'(?:\\.|[^'\\\n])+'", re.S)
_NUMBER = re.compile(r"\.?\d(?:'?[\w.]|(?<=[eEpP])[+-])*")
_WORD = re.compile(r"[A-Za-z_]\w*")
_SIGN = re.compile(r"->\*?|::|\.\.\.|<=>|[-+*/%&|^=!<>]=|&&|\|\||\+\+|--|[^\s\w]")
_INCLUDE = re.compile(r'#\s*include\s*([<"])([^>"]+)[>"]')


def tokenize(text, name="", first_line=1):
    """Preprocessor lines leave nothing but the includes; the bodies of macros are not looked into."""
    source = Source(name)
    at, line, line_start = 0, first_line, True
    while at < len(text):
        c = text[at]
        if c == "\n":
            line, at, line_start = line + 1, at + 1, True
            continue
        if c.isspace() or (c == "\\" and text[at + 1 : at + 2] == "\n"):
            at += 1
            continue
        if text.startswith("//", at):
            end = text.find("\n", at)
            end = len(text) if end < 0 else end
            source.comments[line] = source.comments.get(line, "") + " " + text[at + 2 : end].strip()
            at = end
            continue
        if text.startswith("/*", at):
            end = text.find("*/", at + 2)
            end = len(text) if end < 0 else end + 2
            for offset, part in enumerate(text[at:end].split("\n")):
                source.comments[line + offset] = source.comments.get(line + offset, "") + " " + part.strip(" /*")
            line += text.count("\n", at, end)
            at = end
            continue
        if c == "#" and line_start:
            end = at
            while True:
                end = text.find("\n", end)
                if end < 0:
                    end = len(text)
                    break
                if text[end - 1] != "\\":
                    break
                end += 1
            directive = text[at:end]
            if found := _INCLUDE.match(directive):
                source.includes.append((line, found[1], found[2]))
            if "//" in directive:
                source.comments[line] = directive.split("//", 1)[1].strip()
            line += directive.count("\n")
            at = end
            continue
        line_start = False
        if found := _RAW.match(text, at):
            end = text.find(")" + found[1] + '"', found.end())
            end = len(text) if end < 0 else end + len(found[1]) + 2
            kind = "string"
        elif found := _STRING.match(text, at):
            end, kind = found.end(), "string"
        elif found := _CHAR.match(text, at):
            end, kind = found.end(), "number"
        elif found := _NUMBER.match(text, at):
            end, kind = found.end(), "number"
        elif found := _WORD.match(text, at):
            end, kind = found.end(), "word"
        else:
            found = _SIGN.match(text, at)
            end, kind = found.end(), "sign"
        source.tokens.append(Token(kind, text[at:end], line))
        line += text.count("\n", at, end)
        at = end
    _match_brackets(source.tokens)
    return source


def _match_brackets(tokens):
    partner = {")": "(", "]": "[", "}": "{"}
    open_ones = []
    for i, token in enumerate(tokens):
        if token.kind != "sign":
            continue
        if token.text in "([{":
            open_ones.append(i)
        elif token.text in partner:
            # Text that is not whole (an #if with two heads) may lack partners: drop what cannot match.
            while open_ones and tokens[open_ones[-1]].text != partner[token.text]:
                open_ones.pop()
            if open_ones:
                token.match = open_ones.pop()
                tokens[token.match].match = i


def read(path, name=None):
    return tokenize(Path(path).read_text(encoding="utf-8", errors="replace"), name or str(path))


_SKIPPED = {"build", ".git", ".cache", "node_modules"}


def files_below(root, suffixes):
    """All files of the tree that are ours, in a fixed order, as paths relative to its root."""
    root = Path(root)
    found = []
    for path in root.rglob("*"):
        relative = path.relative_to(root)
        if path.is_file() and path.suffix in suffixes and not _SKIPPED & set(relative.parts):
            found.append(relative)
    return sorted(found)


_BLOCK = re.compile(r"^(?P<indent> *)```(?:cpp|c\+\+|cc)[^\n]*\n(?P<code>.*?)^(?P=indent)```", re.S | re.M | re.I)


def markdown_blocks(text):
    """(line of the first code line, the text between the block before and this one, code) of each C++ block."""
    before = 0
    for found in _BLOCK.finditer(text):
        yield text.count("\n", 0, found.start("code")) + 1, text[before : found.start()], found["code"]
        before = found.end()
