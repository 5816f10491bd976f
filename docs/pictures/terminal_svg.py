#!/usr/bin/env python3
"""Draws what a program shows on a terminal as SVG, in the colours that it printed and no others.

usage: terminal_svg.py TITLE COLUMNSxLINES SECONDS KEYS COMMAND... > picture.svg

Runs the command on a terminal of that size (a pseudo-terminal), types KEYS after SECONDS, waits as long again, and draws the screen.
Then it types q. Understands what ncurses sends to an xterm.
"""
import fcntl
import os
import pty
import re
import select
import struct
import sys
import termios
import time
from html import escape

CELL, LINE, MARGIN, BAR = 7.6, 18, 14, 30
# What "green" is, the terminal decides.
COLOURS = ["#484f58", "#ff7b72", "#7ee787", "#e3b341", "#79c0ff", "#d2a8ff", "#56d4dd", "#e6edf3"]
TEXT, GROUND = "#e6edf3", "#0d1117"
PLAIN = (None, False, False, False)  # colour, bold, dim, reverse
SEQUENCE = re.compile(rb"\x1b(?:\[([0-9;?]*)([@-~])|[()].|[^\[()])")


class Screen:
    def __init__(self, columns, lines):
        self.columns, self.lines = columns, lines
        self.cells = [self.empty() for _ in range(lines)]
        self.row = self.column = self.top = 0
        self.bottom = lines - 1
        self.wrap = False
        self.look = PLAIN
        self.last = " "
        self.rest = b""

    def empty(self):
        return [(" ", PLAIN)] * self.columns

    def feed(self, data):
        data, self.rest = self.rest + data, b""
        while data:
            if data[0] == 0x1B:
                found = SEQUENCE.match(data)
                if not found:
                    break
                if found[2]:
                    self.obey(found[2].decode(), found[1].decode())
                data = data[found.end():]
                continue
            length = 1 if data[0] < 0x80 else 2 if data[0] < 0xE0 else 3 if data[0] < 0xF0 else 4
            if len(data) < length:
                break
            self.put(data[:length].decode(errors="replace"))
            data = data[length:]
        self.rest = data

    def put(self, letter):
        if letter == "\r":
            self.column, self.wrap = 0, False
        elif letter == "\n":
            self.new_line()
        elif letter == "\b":
            self.column, self.wrap = max(0, self.column - 1), False
        elif letter == "\t":
            self.column = min((self.column // 8 + 1) * 8, self.columns - 1)
        elif letter >= " ":
            if self.wrap:
                self.column = 0
                self.new_line()
            self.cells[self.row][self.column] = (letter, self.look)
            self.last = letter
            self.wrap = self.column + 1 == self.columns
            self.column += not self.wrap

    def new_line(self):
        self.wrap = False
        if self.row == self.bottom:
            self.scroll(1)
        elif self.row + 1 < self.lines:
            self.row += 1

    def scroll(self, by):
        for _ in range(abs(by)):
            if by > 0:
                self.cells.insert(self.bottom + 1, self.empty())
                del self.cells[self.top]
            else:
                del self.cells[self.bottom]
                self.cells.insert(self.top, self.empty())

    def erase(self, row, begin, end):
        for at in range(begin, min(end, self.columns)):
            self.cells[row][at] = (" ", PLAIN)

    def obey(self, what, parameters):
        numbers = [int(n) if n.isdigit() else 0 for n in parameters.split(";")] if "?" not in parameters else []
        first = numbers[0] if numbers else 0
        count = max(first, 1)
        if what == "m":
            return self.set_look(numbers)
        self.wrap = False
        line = self.cells[self.row]
        if what == "A":
            self.row = max(0, self.row - count)
        elif what == "B":
            self.row = min(self.lines - 1, self.row + count)
        elif what == "C":
            self.column = min(self.columns - 1, self.column + count)
        elif what == "D":
            self.column = max(0, self.column - count)
        elif what == "G":
            self.column = min(count, self.columns) - 1
        elif what == "d":
            self.row = min(count, self.lines) - 1
        elif what == "H":
            self.row = min(count, self.lines) - 1
            self.column = min(max(numbers[1] if len(numbers) > 1 else 1, 1), self.columns) - 1
        elif what == "J":
            self.erase(self.row, self.column if first == 0 else 0, self.columns)
            for at in range(self.row + 1 if first == 0 else 0, self.lines):
                self.erase(at, 0, self.columns)
        elif what == "K":
            self.erase(self.row, self.column if first == 0 else 0, self.column + 1 if first == 1 else self.columns)
        elif what == "X":
            self.erase(self.row, self.column, self.column + count)
        elif what == "@":
            line[self.column:self.column] = [(" ", PLAIN)] * count
            del line[self.columns:]
        elif what == "P":
            del line[self.column:self.column + count]
            line.extend([(" ", PLAIN)] * (self.columns - len(line)))
        elif what in "LM":
            before, self.top = self.top, self.row
            self.scroll(-count if what == "L" else count)
            self.top = before
        elif what in "ST":
            self.scroll(count if what == "S" else -count)
        elif what == "b":
            for _ in range(count):
                self.put(self.last)
        elif what == "r":
            self.top, self.bottom = count - 1, min(numbers[1] if len(numbers) > 1 else self.lines, self.lines) - 1
            self.row = self.column = 0

    def set_look(self, numbers):
        colour, bold, dim, reverse = self.look
        for number in numbers or [0]:
            if number == 0:
                colour, bold, dim, reverse = PLAIN
            elif number == 1:
                bold = True
            elif number == 2:
                dim = True
            elif number == 7:
                reverse = True
            elif number == 22:
                bold = dim = False
            elif number == 27:
                reverse = False
            elif 30 <= number <= 37:
                colour = number - 30
            elif number == 39:
                colour = None
        self.look = (colour, bold, dim, reverse)


def show(columns, lines, seconds, keys, command):
    """The screen of the command after that time."""
    child, terminal = pty.fork()
    if child == 0:
        os.environ.update(TERM="xterm-256color", COLUMNS=str(columns), LINES=str(lines))
        os.environ.pop("NO_COLOR", None)
        fcntl.ioctl(0, termios.TIOCSWINSZ, struct.pack("HHHH", lines, columns, 0, 0))
        os.execvp(command[0], command)
    screen = Screen(columns, lines)

    def read_for(length):
        until = time.monotonic() + length
        while (left := until - time.monotonic()) > 0:
            if select.select([terminal], [], [], left)[0]:
                try:
                    data = os.read(terminal, 65536)
                except OSError:  # it has ended
                    return
                if not data:
                    return
                screen.feed(data)

    read_for(seconds)
    if keys:
        os.write(terminal, keys.encode())
        read_for(seconds)
    try:
        os.write(terminal, b"q")
    except OSError:
        pass
    os.close(terminal)
    os.waitpid(child, 0)
    return screen


def line_svg(cells, number):
    """The runs of cells with the same look."""
    top = BAR + MARGIN + LINE * number
    parts, at = [], 0
    while at < len(cells):
        end = at
        while end < len(cells) and cells[end][1] == cells[at][1]:
            end += 1
        text, (colour, bold, dim, reverse) = "".join(letter for letter, _ in cells[at:end]), cells[at][1]
        x = MARGIN + CELL * at
        ink = TEXT if colour is None else COLOURS[colour]
        if reverse:
            parts.append(f'  <rect x="{x:g}" y="{top - 2:g}" width="{CELL * (end - at):g}" height="{LINE}" fill="{ink}"/>')
            ink = GROUND
        text = text.rstrip()
        if text:
            style = ' font-weight="bold"' if bold else ""
            style += ' fill-opacity="0.6"' if dim else ""
            style += f' fill="{ink}"' if ink != TEXT else ""
            parts.append(f'  <text x="{x:g}" y="{top + 12:g}" textLength="{CELL * len(text):g}" lengthAdjust="spacingAndGlyphs" xml:space="preserve"{style}>{escape(text)}</text>')
        at = end
    return "\n".join(parts)


def main():
    if len(sys.argv) < 6 or not (size := re.fullmatch(r"(\d+)x(\d+)", sys.argv[2])):
        sys.exit(__doc__)
    title, seconds, keys = sys.argv[1], float(sys.argv[3]), sys.argv[4].encode().decode("unicode_escape")
    screen = show(int(size[1]), int(size[2]), seconds, keys, sys.argv[5:])
    if not any(letter != " " for row in screen.cells for letter, _ in row):
        sys.exit(f"terminal_svg.py: {sys.argv[5]} has shown nothing")
    width = round(screen.columns * CELL + 2 * MARGIN)
    height = BAR + 2 * MARGIN + LINE * screen.lines
    print(f'<svg xmlns="http://www.w3.org/2000/svg" width="{width}" height="{height}" viewBox="0 0 {width} {height}" role="img" aria-label="{escape(title)}">')
    print(f'  <rect width="{width}" height="{height}" rx="8" fill="{GROUND}"/>')
    print(f'  <text x="{width / 2:g}" y="20" fill="#8b949e" font-family="sans-serif" font-size="13" text-anchor="middle">{escape(title)}</text>')
    print(f'  <g font-family="DejaVu Sans Mono, Menlo, Consolas, monospace" font-size="12.5" fill="{TEXT}">')
    print("\n".join(text for number, row in enumerate(screen.cells) if (text := line_svg(row, number))))
    print("  </g>\n</svg>")


main()
