#!/usr/bin/env python3
"""Finds the forms of co_await that g++ 12 miscompiles (dropped bodies, objects freed twice).

usage: coroutine.py ROOT          all *.hpp, *.cpp, and the C++ blocks of *.md below it
A finding that is known to be harmless is excused on its line by "// NOLINT(coroutine): why", or on the line
before by NOLINTNEXTLINE; the reason is required. A block of a document that shows a bad form on purpose stands
after "<!-- lint: skip: why -->".

The types are not known here, so what may be a non-trivial aggregate counts as one. The way out is always the
same: give the value a name in a statement of its own and await with the name.
"""

import re
import sys
from pathlib import Path

from cpp_structs import AggregateIndex
from cpp_tokens import files_below, markdown_blocks, read, tokenize

CONTROL = {"if", "while", "for", "switch", "catch"}
OPERAND_KEYWORDS = {"return", "co_return", "co_await", "co_yield", "case", "else", "do", "new", "throw"}
BLOCK_KEYWORDS = {"else", "do", "try", "const", "noexcept", "override", "final", "mutable", "requires", "volatile"}
CLASS_KEYS = {"struct", "class", "union", "enum", "namespace", "extern", "concept"}

# Constructed by constructors or trivial: braces around these make no aggregate temporary.
SAFE_BRACED = re.compile(
    r"^(?:::)?(?:std::)?(?:u?int(?:_fast|_least)?\d*(?:ptr|max)?_t|size_t|ptrdiff_t|byte|string|string_view|span|nullopt_t|"
    r"monostate|error_code|(?:chrono::)(?:\w+)|(?:nano|micro|milli)?seconds|minutes|hours|int|unsigned|long|bool|char|"
    r"float|double|u8string)$"
)



class File:
    """The checks over one tokenised source."""

    def __init__(self, source, aggregates):
        self.tokens = source.tokens
        self.source = source
        self.aggregates = aggregates
        self.lambdas = {}  # index of "[" -> (index of "]", index of the body's "{")
        self.lambda_bodies = set()
        self._find_lambdas()
        self.blocks = {i: self._is_block(i) for i, t in enumerate(self.tokens) if t.text == "{" and t.kind == "sign"}

    # -- shape ----------------------------------------------------------------------------------------------

    def text(self, i):
        return self.tokens[i].text if 0 <= i < len(self.tokens) and self.tokens[i].kind != "string" else ""

    def _find_lambdas(self):
        for i, token in enumerate(self.tokens):
            if token.text != "[" or token.kind != "sign" or token.match < 0:
                continue
            before = self.tokens[i - 1] if i else None
            if self.text(i + 1) == "[" or self.text(i - 1) == "[" and self.tokens[i - 1].match == token.match + 1:
                continue  # an attribute
            if before and before.kind in ("number", "string"):
                continue
            if before and before.kind == "word" and before.text not in OPERAND_KEYWORDS:
                continue  # a subscript, an array
            if before and before.text in (")", "]"):
                continue
            at = token.match + 1
            if self.text(at) == "<":
                at = self._after_angles(at)
            if self.text(at) == "(":
                at = self.tokens[at].match + 1
                if at == 0:
                    continue
            elif self.text(at) not in ("{", "mutable", "noexcept", "->", "constexpr"):
                continue
            for at in range(at, min(at + 60, len(self.tokens))):
                if self.text(at) == "{":
                    if self.tokens[at].match > 0:
                        self.lambdas[i] = (token.match, at)
                        self.lambda_bodies.add(at)
                    break
                if self.text(at) in (";", ")", "}", "]", "="):
                    break

    def _after_angles(self, at):
        depth = 0
        for i in range(at, min(at + 200, len(self.tokens))):
            if self.text(i) == "<":
                depth += 1
            elif self.text(i) == ">":
                depth -= 1
                if depth == 0:
                    return i + 1
        return at + 1

    def _before_angles(self, at):
        """The index before the "<" that the ">" at `at` closes."""
        depth = 0
        for i in range(at, max(at - 200, -1), -1):
            if self.text(i) in (")", "]", "}") and self.tokens[i].match < 0:
                return at - 1
            if self.text(i) == ">":
                depth += 1
            elif self.text(i) == "<":
                depth -= 1
                if depth == 0:
                    return i - 1
        return at - 1

    def _name_before(self, brace):
        """(the type name written before a brace, the index before the name)."""
        at = brace - 1
        if self.text(at) == ">":
            at = self._before_angles(at)
        words = []
        while at >= 0 and (self.tokens[at].kind == "word" and (not words or words[-1] == "::") or self.text(at) == "::"):
            if self.tokens[at].kind == "word" and self.tokens[at].text in OPERAND_KEYWORDS:
                break
            words.append(self.text(at))
            at -= 1
            if words[-1] == "::" and self.text(at) == ">":
                at = self._before_angles(at)
        return "".join(reversed(words)), at

    def _is_block(self, i):
        if i in self.lambda_bodies or i == 0:
            return True
        before = self.tokens[i - 1]
        if before.kind == "string":
            return self.text(i - 2) == "extern"
        if before.text in (")", ";", "}", ":"):
            return True
        if before.text == "{":
            return self._is_block(i - 1)
        if before.text in ("&", "&&"):
            return self.text(i - 2) in (")", "const")
        if before.kind == "word" and before.text in BLOCK_KEYWORDS:
            return True
        if before.kind == "word" or before.text == ">":
            _, at = self._name_before(i)
            while self.text(at) in ("&", "*", "const", "typename"):
                at -= 1
            if self.text(at) == "->":
                return True
            return self._statement_has_class_key(i)
        return False

    def _statement_has_class_key(self, brace):
        at = brace - 1
        while at >= 0:
            text = self.text(at)
            if text in (";", "{", "}", "="):
                return False
            if text in (")", "]") and self.tokens[at].match >= 0:
                at = self.tokens[at].match - 1
                continue
            if text == "(":
                return False
            if text in CLASS_KEYS:
                return True
            at -= 1
        return False

    # -- the full expression around a co_await --------------------------------------------------------------

    def _ternary_before(self, colon, stop):
        depth = 0
        at = colon - 1
        while at > stop:
            text = self.text(at)
            if text in (")", "]", "}") and self.tokens[at].match >= 0:
                at = self.tokens[at].match
            elif text in (";", "(", "{", "["):
                return False
            elif text == ":":
                depth += 1
            elif text == "?":
                if depth == 0:
                    return True
                depth -= 1
            at -= 1
        return False

    def full_expression(self, i):
        """[first, last) of the statement or condition around i, and the "{" of the braced initialisers around i."""
        braces = []
        at = i - 1
        first = 0
        while at >= 0:
            text = self.text(at)
            if text in (")", "]", "}"):
                opening = self.tokens[at].match
                if opening < 0:
                    first = at + 1
                    break
                if text == "}" and self.blocks[opening] and opening not in self.lambda_bodies:
                    first = at + 1
                    break
                head = opening - 1
                if text == ")" and self.text(head) == "constexpr":
                    head -= 1
                if text == ")" and self.text(head) in CONTROL:
                    first = at + 1
                    break
                at = opening - 1
                continue
            if text == "{":
                if self.blocks[at]:
                    first = at + 1
                    break
                braces.append(at)
            elif text == "(" and (self.text(at - 1) in CONTROL or self.text(at - 2) in CONTROL and self.text(at - 1) == "constexpr"):
                first = at + 1
                break
            elif text == ";" or text in ("else", "do"):
                first = at + 1
                break
            elif text == ":" and not self._ternary_before(at, -1):
                first = at + 1
                break
            at -= 1
        # The end: ";" outside of the brackets that were opened since `first`.
        at = i
        last = len(self.tokens)
        while at < len(self.tokens):
            text = self.text(at)
            if text in ("(", "[", "{") and self.tokens[at].match > at:
                at = self.tokens[at].match
            elif text == ";":
                last = at
                break
            elif text in (")", "}", "]") and (self.tokens[at].match < first):
                last = at
                break
            at += 1
        return first, last, braces

    def visible(self, first, last):
        """Indices in [first, last) that are not inside the body of a lambda."""
        at = first
        while at < last:
            yield at
            if at in self.lambda_bodies:
                at = self.tokens[at].match
            else:
                at += 1

    # -- the rules ------------------------------------------------------------------------------------------

    def findings(self):
        found = set()
        seen = set()
        for i, token in enumerate(self.tokens):
            if token.kind != "word":
                continue
            if token.text in CONTROL and token.text != "catch":
                found |= self._condition(i)
            if token.text == "co_await" and self.text(i - 1) != "operator":
                first, last, braces = self.full_expression(i)
                if braces:
                    found.add((5, token.line, "co_await inside a braced initialiser: await into a variable first"))
                if (first, last) not in seen:
                    seen.add((first, last))
                    found |= self._expression(first, last)
        found |= self._invoked_lambdas() | self._default_arguments()
        return sorted(found, key=lambda f: (f[1], f[0]))

    def _condition(self, i):
        opening = i + 1
        if self.text(opening) == "constexpr":
            opening += 1
        if self.text(opening) != "(" or self.tokens[opening].match < 0:
            return set()
        closing = self.tokens[opening].match
        parts, start, colon = [], opening + 1, False
        depth_end = -1
        for at in self.visible(opening + 1, closing):
            if at <= depth_end:
                continue
            text = self.text(at)
            if text in ("(", "[", "{") and self.tokens[at].match > at and at not in self.lambda_bodies:
                depth_end = self.tokens[at].match
            elif text == ";":
                parts.append((start, at))
                start = at + 1
            elif text == ":" and not self._ternary_before(at, opening):
                colon = True
        parts.append((start, closing))
        keyword = self.text(i)
        if keyword == "for":
            if colon or len(parts) < 3:
                return set()  # a range-for over an awaited value is safe
            first, last = parts[1]
        else:
            first, last = parts[-1]
        return {
            (1, self.tokens[at].line, f"co_await in the condition of `{keyword}`: await into a variable first")
            for at in self.visible(first, last)
            if self.text(at) == "co_await"
        }

    def _expression(self, first, last):
        found = set()
        inside = list(self.visible(first, last))
        for at in inside:
            token = self.tokens[at]
            if token.kind == "string":
                continue
            if token.text == "{" and not self.blocks[at]:
                found |= self._braced_temporary(at, first)
            elif token.text == "(" and at > first:
                name, before = self._name_before(at)
                if name and self.text(before) not in (".", "->") and self.aggregates.is_nontrivial(name):
                    found.add((2, token.line, f"`{name}(…)` may be an aggregate temporary in a co_await expression: name it first"))
            elif token.text == "[" and at in self.lambdas:
                if what := self._nontrivial_capture(at):
                    found.add((3, token.line, f"a temporary closure with the capture `{what}` in a co_await expression: name it first"))
            elif token.text == "?":
                found |= self._ternary(at, last)
        return found

    def _braced_temporary(self, brace, first):
        """A declaration's own initialiser (`auto x{…}`) is no temporary, but then holds the co_await: rule 5."""
        name, before = self._name_before(brace)
        line = self.tokens[brace].line
        if not name:
            if before >= first and self.text(before) in ("operator", "]"):
                return set()
            return {(2, line, "a braced temporary in a co_await expression: give it a name first")}
        if SAFE_BRACED.match(name) or self.aggregates.is_trivial(name):
            return set()
        if before >= first and (self.tokens[before].kind == "word" and self.text(before) not in OPERAND_KEYWORDS or self.text(before) in (">", "&", "*")):
            return set()  # `type name{…}`: a named variable
        return {(2, line, f"`{name}{{…}}` may be an aggregate temporary in a co_await expression: give it a name first")}

    def _nontrivial_capture(self, opening):
        closing, _ = self.lambdas[opening]
        start, at = opening + 1, opening + 1
        while at <= closing:
            if at == closing or self.text(at) == ",":
                words = [self.tokens[k].text for k in range(start, at)]
                if words and not (words[0] == "this" or words[0] == "&" and "=" not in words):
                    # &x = y is a reference too.
                    if words[0] != "&":
                        return " ".join(words)
                start = at + 1
            elif self.text(at) in ("(", "[", "{") and self.tokens[at].match > at:
                at = self.tokens[at].match
            at += 1
        return ""

    def _ternary(self, question, last):
        arms, start, depth = [], question + 1, 0
        at = question + 1
        while at < last:
            text = self.text(at)
            if text in ("(", "[", "{") and self.tokens[at].match > at:
                at = self.tokens[at].match
            elif text in (")", "]", "}", ",", ";"):
                break
            elif text == "?":
                depth += 1
            elif text == ":":
                if depth == 0:
                    arms.append((start, at))
                    start = at + 1
                else:
                    depth -= 1
            at += 1
        arms.append((start, at))
        line = self.tokens[question].line
        everything = [k for first, end in arms for k in self.visible(first, end)]
        if any(self.text(k) == "co_await" for k in everything):
            return {(4, line, "co_await in an arm of ?: — use if and a variable")}
        strings = [all(self.tokens[k].kind == "string" for k in range(*arm)) for arm in arms]
        has_string = any(self.tokens[k].kind == "string" for k in everything)
        makes = any(self.text(k) in ("(", "{") for k in everything)
        if makes or (has_string and not all(strings)):
            return {(4, line, "a ?: that may yield a temporary in a co_await expression: name its value first")}
        return set()

    def _invoked_lambdas(self):
        """A coroutine lambda with captures that is invoked at once, unless awaited there: its captures die first."""
        found = set()
        for opening, (closing, body) in self.lambdas.items():
            end = self.tokens[body].match
            if closing == opening + 1 or self.text(end + 1) != "(":
                continue
            coroutine = any(self.text(k) in ("co_await", "co_return", "co_yield") for k in range(body, end))
            if not coroutine or self.text(opening - 1) == "co_await":
                continue
            first, last, _ = self.full_expression(opening)
            if any(self.text(k) == "co_await" for k in self.visible(first, last)):
                continue
            found.add((3, self.tokens[opening].line, "a capturing coroutine lambda is invoked at once and its captures die with it: "
                       "hand over the lambda itself, or pass parameters by value"))
        return found

    def _default_arguments(self):
        found = set()
        for i, token in enumerate(self.tokens):
            if token.text != "(" or token.kind != "sign" or token.match < 0 or i < 3:
                continue
            if self.tokens[i - 1].kind != "word" or self.text(i - 2) != ">":
                continue  # only `task<…> name(` and `awaitable<…> name(`
            name, _ = self._name_before(i - 1)
            if name.split("::")[-1] not in ("task", "awaitable"):
                continue
            at = i + 1
            while at < token.match:
                if self.text(at) == "=":
                    value = at + 1
                    end = value
                    while self.tokens[end].kind == "word" or self.text(end) == "::":
                        end += 1
                    if self.text(end) == "{":
                        type_name = "".join(self.tokens[k].text for k in range(value, end))
                        if not type_name:  # `Opt o = {…}`: the parameter's type
                            type_name, _ = self._name_before(at - 1)
                        if not (SAFE_BRACED.match(type_name) or self.aggregates.is_trivial(type_name)):
                            found.add((6, self.tokens[at].line, "a defaulted aggregate argument of a coroutine: write an overload instead"))
                if self.text(at) in ("(", "[", "{") and self.tokens[at].match > at:
                    at = self.tokens[at].match
                at += 1
        return found


_EXCUSE = re.compile(r"NOLINT(NEXTLINE)?\(coroutine\)[:\s]*(.*)")


def check(source, aggregates):
    """[(rule, line, text)] of one source, the excused left out; an excuse without a reason is a finding (rule 0)."""
    excused, found = set(), []
    for line, comment in source.comments.items():
        if match := _EXCUSE.search(comment):
            if not match[2].strip():
                found.append((0, line, "NOLINT(coroutine) without a reason"))
            excused.add(line + 1 if match[1] else line)
    found += [f for f in File(source, aggregates).findings() if f[1] not in excused]
    return found


def sources_of(root):
    root = Path(root)
    for path in files_below(root, {".hpp", ".cpp", ".h", ".inl"}):
        yield read(root / path, str(path))
    for path in files_below(root, {".md"}):
        for line, before, code in markdown_blocks((root / path).read_text(encoding="utf-8", errors="replace")):
            if not re.search(r"<!--\s*lint: skip:\s*\S.*?-->\s*$", before):
                yield tokenize(code, str(path), line)


def main():
    if len(sys.argv) != 2 or not Path(sys.argv[1]).is_dir():
        print("usage: coroutine.py ROOT", file=sys.stderr)
        return 2
    sources = list(sources_of(sys.argv[1]))
    if not sources:
        print(f"coroutine.py: no source below {sys.argv[1]}", file=sys.stderr)
        return 1
    aggregates = AggregateIndex(sources)
    count = 0
    for source in sources:
        for rule, line, text in check(source, aggregates):
            print(f"{source.name}:{line}: coroutine law, rule {rule}: {text}")
            count += 1
    print(f"{len(sources)} sources, {count} findings")
    return 1 if count else 0


if __name__ == "__main__":
    sys.exit(main())
