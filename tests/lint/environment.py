#!/usr/bin/env python3
"""Nothing in ise/ and components/ reaches the world but through the environment of its node.

usage: environment.py ROOT
Excepted: ise/core/real*, and files that say in a comment of their first ten lines why they must:
    // environment-boundary: Boost.Process starts processes by itself
A single line is excused by "// NOLINT(environment): why".
"""

import re
import sys
from pathlib import Path

from cpp_tokens import files_below, read

# Patterns over the tokens joined by one blank, with what to use instead.
FORBIDDEN = [
    (r"\b\w*_clock :: now\b", "reads a clock: ask the environment's"),
    # Through an alias; a member function's definition is none.
    (r"\b(?!\w*_clock\b)\w+ :: now \( \)(?! (?:const|noexcept|override|\{))", "reads a clock: ask the environment's"),
    (r"\b(?:gettimeofday|clock_gettime|timespec_get|ftime) \(|(?:std )?:: time \(", "reads a clock: ask the environment's"),
    (r"\bthis_thread :: sleep_\w+|\b(?:usleep|nanosleep|clock_nanosleep) \(|(?:(?<!\w )|(?<=return ))(?<!\w):: sleep \(", "sleeps: await the environment's timer"),
    (r"\b(?:steady_timer|system_timer|high_resolution_timer|deadline_timer)\b", "a timer of Asio's own runs on the real clock: use the environment's"),
    (r"\brandom_device\b|\b(?:srand|getrandom|getentropy|arc4random) \(|\bstd :: rand \(", "draws a random number: ask the environment"),
    (r"\b(?:secure_)?getenv \(", "reads the process's variables: a program does that, and passes the value"),
    (r"\b(?:tcp|udp|icmp) :: (?:socket|acceptor|resolver|iostream)\b", "opens a socket: ask the environment"),
    (r"\b(?:stream_protocol|datagram_protocol|seq_packet_protocol) :: (?:socket|acceptor)\b", "opens a socket: ask the environment"),
    (r"\b(?:asio|net) :: (?:serial_port|signal_set|stream_file|random_access_file)\b", "opens a device, a file or a signal: ask the environment"),
    (r"\bposix :: (?:basic_)?(?:stream_)?descriptor\b", "opens a descriptor: ask the environment"),
    (r"(?:(?<!\w )|(?<=return ))(?<!\w):: (?:socket|accept|bind|listen|connect|open|openat|creat|fork|kill|sigaction|signal) \(", "calls the operating system: ask the environment"),
    (r"\b(?:fopen|freopen|popen|tmpfile|mkstemp|mkdtemp) \(", "opens a file: ask the environment's storage"),
    (r"\bstd :: (?:basic_)?[io]?fstream\b", "opens a file: ask the environment's storage"),
    (r"\bfilesystem :: (?!path\b)\w+", "touches the file system: ask the environment's storage"),
]
COMPILED = [(re.compile(pattern), why) for pattern, why in FORBIDDEN]
BOUNDARY = re.compile(r"environment-boundary:\s*(\S.*)?")
EXCUSE = re.compile(r"NOLINT\(environment\)[:\s]*(\S.*)?")


def findings_in(source):
    """[(line, text)] of one tokenised source."""
    for line, comment in source.comments.items():
        if line <= 10 and (match := BOUNDARY.search(comment)):
            return [] if match[1] else [(line, "environment-boundary without a reason")]
    found, excused = [], set()
    for line, comment in source.comments.items():
        if match := EXCUSE.search(comment):
            excused.add(line)
            if not match[1]:
                found.append((line, "NOLINT(environment) without a reason"))
    # One text for all tokens; where each begins leads back to its line.
    starts, texts, at = [], [], 0
    for token in source.tokens:
        text = '""' if token.kind == "string" else token.text
        starts.append((at, token.line))
        texts.append(text)
        at += len(text) + 1
    joined = " ".join(texts)
    lines = dict(starts)
    for pattern, why in COMPILED:
        for match in pattern.finditer(joined):
            begin = match.start()
            while begin not in lines and begin < match.end():
                begin += 1
            line = lines.get(begin, 0)
            if line not in excused:
                found.append((line, f"`{match[0].strip(' (')}` {why}"))
    return sorted(set(found))


def main():
    if len(sys.argv) != 2 or not (Path(sys.argv[1]) / "ise").is_dir():
        print("usage: environment.py ROOT", file=sys.stderr)
        return 2
    root, count = Path(sys.argv[1]), 0
    for path in files_below(root, {".hpp", ".cpp", ".h"}):
        if path.parts[0] not in ("ise", "components") or path.as_posix().startswith("ise/core/real"):
            continue
        for line, text in findings_in(read(root / path)):
            print(f"{path}:{line}: {text}")
            count += 1
    print(f"{count} findings")
    return 1 if count else 0


if __name__ == "__main__":
    sys.exit(main())
