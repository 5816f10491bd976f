"""Schemas as LAYOUT.md writes them: reads the canonical text, writes it again, hashes it."""
import re
from dataclasses import dataclass, field

INTEGERS = {"i8": 1, "u8": 1, "i16": 2, "u16": 2, "i32": 4, "u32": 4, "i64": 8, "u64": 8}
SCALARS = {"bool": 1, "char": 1, "byte": 1, "f32": 4, "f64": 8, **INTEGERS}
NAME = rb"[A-Za-z0-9_\x80-\xff]+"
OPAQUE_NAME = rb"[A-Za-z0-9_\x80-\xff.:/-]+"
NUMBER = rb"0|[1-9][0-9]*"
SIGNED = rb"-[1-9][0-9]*|" + NUMBER
MOST_LEVELS = 200  # far below where Python itself gives up


class SchemaError(ValueError):
    """A text that the grammar does not allow; says where."""


@dataclass
class Type:
    """A node of a schema: `kind` is the word the text begins with."""

    kind: str
    name: str = ""  # of a struct, enum or opaque type
    inner: list["Type"] = field(default_factory=list)
    names: list[str] = field(default_factory=list)  # of fields or enumerators
    presets: list[bytes | None] = field(default_factory=list)  # of fields
    values: list[int] = field(default_factory=list)  # of enumerators
    count: int = 0  # of an array; the version of an opaque type
    integer: str = ""  # under an enum; what a duration or time point counts in
    period: tuple[int, int] = (1, 1)

    def text(self, names: bool = True) -> str:
        """The canonical text; without names of types and without presets it is what is hashed."""
        inner = ",".join(each.text(names) for each in self.inner)
        title = self.kind + (" " + self.name if names and self.name else "")
        match self.kind:
            case "struct":
                parts = [f"{name}:{of.text(names)}" + (f"={preset.hex()}" if names and preset is not None else "")
                         for name, of, preset in zip(self.names, self.inner, self.presets)]
                return f"{title}{{{','.join(parts)}}}"
            case "enum":
                parts = [f"{name}={value}" for name, value in zip(self.names, self.values)]
                return f"{title}:{self.integer}{{{','.join(parts)}}}"
            case "array":
                return f"array<{inner},{self.count}>"
            case "opaque":
                return f"opaque<{self.name},{self.count}>"
            case "duration" | "time":
                return f"{self.kind}<{self.integer},{self.period[0]}/{self.period[1]}>"
            case _:
                return f"{self.kind}<{inner}>" if self.inner or self.kind == "tuple" else self.kind

    def min_bytes(self) -> int:
        """The fewest bytes that a value takes."""
        match self.kind:
            case "struct" | "tuple":
                return sum(each.min_bytes() for each in self.inner)
            case "array":
                return self.count * self.inner[0].min_bytes()
            case "enum":
                return INTEGERS[self.integer]
            case "optional":
                return 1
            case "variant":
                return self.index_bytes() + min(each.min_bytes() for each in self.inner)
            case "duration" | "time":
                return 8
            case _:
                return SCALARS.get(self.kind, 4)

    def index_bytes(self) -> int:
        return 1 if len(self.inner) <= 255 else 2

    def natural(self) -> bytes:
        """The encoded value that needs no preset."""
        match self.kind:
            case "struct":
                return b"".join(preset if preset is not None else of.natural()
                                for of, preset in zip(self.inner, self.presets))
            case "tuple":
                return b"".join(each.natural() for each in self.inner)
            case "array":
                return self.inner[0].natural() * self.count
            case "variant":
                return bytes(self.index_bytes()) + self.inner[0].natural()
            case _:
                return bytes(self.min_bytes())


class _Reader:
    def __init__(self, text: bytes):
        self.text, self.at = text, 0

    def fail(self, what: str):
        raise SchemaError(f"at byte {self.at} of the schema text: {what}, but there is {self.text[self.at:self.at + 20]!r}")

    def take(self, pattern: bytes, what: str) -> str:
        found = re.compile(pattern).match(self.text, self.at)
        if not found:
            self.fail(f"{what} is expected")
        self.at = found.end()
        return found[0].decode("utf-8", "surrogateescape")

    def skip(self, token: bytes) -> bool:
        if not self.text.startswith(token, self.at):
            return False
        self.at += len(token)
        return True

    def need(self, token: bytes):
        if not self.skip(token):
            self.fail(f"{token.decode()!r} is expected")

    def number(self) -> int:
        return int(self.take(NUMBER, "a number"))

    def type(self, level: int = 0) -> Type:
        if level > MOST_LEVELS:
            self.fail("no more than 200 levels are expected")
        kind = self.take(rb"[a-z]+[0-9]*", "a type")
        out = Type(kind)
        if kind in SCALARS or kind == "string":
            return out
        if kind == "struct":
            return self.struct(out, level)
        if kind == "enum":
            return self.enum(out)
        self.need(b"<")
        if kind in ("vector", "set", "optional"):
            out.inner = [self.type(level + 1)]
        elif kind == "map":
            out.inner.append(self.type(level + 1))
            self.need(b",")
            out.inner.append(self.type(level + 1))
        elif kind == "array":
            out.inner = [self.type(level + 1)]
            self.need(b",")
            out.count = self.number()
        elif kind in ("variant", "tuple"):
            if kind == "variant" or not self.text.startswith(b">", self.at):
                out.inner.append(self.type(level + 1))
                while self.skip(b","):
                    out.inner.append(self.type(level + 1))
        elif kind in ("duration", "time"):
            out.integer = self.take(rb"i64|f64", "i64 or f64")
            self.need(b",")
            up = self.number()
            self.need(b"/")
            out.period = (up, self.number())
        elif kind == "opaque":
            out.name = self.take(OPAQUE_NAME, "the name of an opaque type")
            self.need(b",")
            out.count = self.number()
        else:
            self.fail(f"{kind} is no type; one is expected")
        self.need(b">")
        return out

    def enum(self, out: Type) -> Type:
        if self.skip(b" "):
            out.name = self.take(NAME, "the name of an enum")
        self.need(b":")
        out.integer = self.take(rb"[iu](?:8|16|32|64)", "an integer")
        self.need(b"{")
        while not self.skip(b"}"):
            if out.names:
                self.need(b",")
            out.names.append(self.take(NAME, "an enumerator"))
            self.need(b"=")
            out.values.append(int(self.take(SIGNED, "a number")))
            if out.values[-2:] != sorted(set(out.values[-2:])):
                self.fail("enumerators by ascending value are expected")
        return out

    def struct(self, out: Type, level: int) -> Type:
        if self.skip(b" "):
            out.name = self.take(NAME, "the name of a struct")
        self.need(b"{")
        while not self.skip(b"}"):
            if out.names:
                self.need(b",")
            out.names.append(self.take(NAME, "a field's name"))
            if out.names[-1] in out.names[:-1]:
                self.fail("fields with different names are expected")
            self.need(b":")
            out.inner.append(self.type(level + 1))
            preset = None
            if self.skip(b"="):
                preset = bytes.fromhex(self.take(rb"(?:[0-9a-f]{2})+", "a preset"))
                if preset == out.inner[-1].natural():
                    self.fail("a preset that is not the natural value is expected")
            out.presets.append(preset)
        return out


def parse(text: str | bytes) -> Type:
    """Reads a canonical text. Throws SchemaError."""
    raw = text.encode("utf-8", "surrogateescape") if isinstance(text, str) else text
    reader = _Reader(raw)
    out = reader.type()
    if reader.at != len(raw):
        reader.fail("the end is expected")
    return out


def fingerprint(of: Type) -> int:
    """FNV-1a of the text without names of types and presets, then fmix64."""
    most = (1 << 64) - 1
    h = 0xCBF29CE484222325
    for byte in of.text(names=False).encode("utf-8", "surrogateescape"):
        h = (h ^ byte) * 0x100000001B3 & most
    h ^= h >> 33
    h = h * 0xFF51AFD7ED558CCD & most
    h ^= h >> 33
    h = h * 0xC4CEB9FE1A85EC53 & most
    return h ^ h >> 33
