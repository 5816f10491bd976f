"""Which structs of the tree are aggregates, and which of those have trivial members only."""

import re

_TRIVIAL_WORDS = re.compile(
    r"^(?:std|chrono|const|unsigned|signed|int|long|short|char|bool|float|double|u?int\d+_t|size_t|ptrdiff_t|byte|"
    r"nanoseconds|microseconds|milliseconds|seconds|minutes|hours|string_view|char8_t|char16_t|char32_t|constexpr)$"
)


class AggregateIndex:
    """Names are compared without their namespaces; a name with two meanings counts as the worse one."""

    def __init__(self, sources):
        self._trivial, self._nontrivial, self._enums = set(), set(), set()
        members = {}
        for source in sources:
            self._scan(source.tokens, members)
        known = {name: all(trivial for trivial, _ in kinds) for name, kinds in members.items()}
        changed = True
        while changed:  # a struct of trivial structs is trivial
            changed = False
            for name, kinds in members.items():
                if not known[name]:
                    if all(all(_TRIVIAL_WORDS.match(w) or w in self._enums or known.get(w) for w in words) for _, words in kinds):
                        known[name] = changed = True
        for name, trivial in known.items():
            (self._trivial if trivial else self._nontrivial).add(name)

    def is_trivial(self, name):
        return name.split("::")[-1] in self._trivial

    def is_nontrivial(self, name):
        return name.split("::")[-1] in self._nontrivial

    def _scan(self, tokens, members):
        for i, token in enumerate(tokens):
            if token.kind != "word" or token.text not in ("struct", "enum") or i + 2 >= len(tokens):
                continue
            at = i + 1
            if token.text == "enum" and tokens[at].text in ("class", "struct"):
                at += 1
            if tokens[at].kind != "word":
                continue
            name = tokens[at].text
            if token.text == "enum":
                self._enums.add(name)
                continue
            if i and tokens[i - 1].text == "enum":
                continue
            if tokens[at + 1].text == "final":
                at += 1
            if tokens[at + 1].text != "{" or tokens[at + 1].match < 0:
                continue  # a declaration, or it has bases
            body = self._members(name, tokens, at + 1)
            if body is not None:
                members.setdefault(name, []).append(body)

    def _members(self, name, tokens, opening):
        """(False, words of the member types), or None where it is no aggregate."""
        words = []
        at, closing = opening + 1, tokens[opening].match
        while at < closing:
            statement = []
            is_function = False
            while at < closing and tokens[at].text != ";":
                token = tokens[at]
                if token.text in ("private", "protected", "virtual"):
                    return None
                if token.text == "(":
                    if statement and statement[-1] == name and "=" not in statement:
                        return None  # a constructor
                    is_function = is_function or "=" not in statement
                if token.text in ("(", "{", "[") and token.match > at:
                    at = token.match
                    if tokens[at].text == "}" and is_function:
                        at += 1
                        break
                else:
                    statement.append(token.text)
                at += 1
            else:
                at += 1
            if is_function or not statement or statement[0] in ("static", "using", "friend", "struct", "enum", "template", "typedef"):
                continue
            if "=" in statement:
                statement = statement[: statement.index("=")]
            # `double a, b` or `std::array<int, 3> c`: without the declared names.
            if "<" not in statement and "*" not in statement and "&" not in statement:
                commas = [k for k, text in enumerate(statement) if text == ","]
                drop = {commas[0] - 1} | {k + 1 for k in commas} if commas else {len(statement) - 1}
                statement = [text for k, text in enumerate(statement) if k not in drop]
            words += [text for text in statement if text not in ("::", ",")]
        return False, words
