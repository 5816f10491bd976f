#!/usr/bin/env python3
"""Draws a terminal's text as SVG: `ise top --once | terminal_svg.py "ise top" > top.svg`. Plain text only; no escapes."""
import sys
from html import escape

CELL, LINE, MARGIN, BAR = 7.6, 18, 14, 30
COLOURS = {"ready": "#7ee787", "stalled": "#ff7b72", "no answer": "#ff7b72", "starting": "#d29922", "failed": "#ff7b72"}


def line_svg(text, number):
    y = BAR + MARGIN + LINE * number + 12
    heading = bool(text) and text.upper() == text and any(letter.isalpha() for letter in text)
    first = next((word for word in COLOURS if text.startswith(word)), "")
    style = ' fill="#79c0ff" font-weight="bold"' if heading else ""
    body = escape(text)
    if first:
        body = f'<tspan fill="{COLOURS[first]}">{escape(first)}</tspan>' + escape(text[len(first):])
    return f'  <text x="{MARGIN}" y="{y}" xml:space="preserve"{style}>{body}</text>'


def main():
    title = sys.argv[1] if len(sys.argv) > 1 else ""
    lines = sys.stdin.read().rstrip("\n").split("\n")
    columns = max(len(line) for line in lines)
    width = round(columns * CELL + 2 * MARGIN)
    height = BAR + 2 * MARGIN + LINE * len(lines)
    print(f'<svg xmlns="http://www.w3.org/2000/svg" width="{width}" height="{height}" viewBox="0 0 {width} {height}" role="img" aria-label="{escape(title)}">')
    print(f'  <rect width="{width}" height="{height}" rx="8" fill="#0d1117"/>')
    print(f'  <rect width="{width}" height="{BAR}" rx="8" fill="#21262d"/>')
    for number, colour in enumerate(("#ff5f56", "#ffbd2e", "#27c93f")):
        print(f'  <circle cx="{18 + 20 * number}" cy="{BAR / 2:g}" r="6" fill="{colour}"/>')
    print(f'  <text x="{width / 2:g}" y="20" fill="#8b949e" font-family="sans-serif" font-size="13" text-anchor="middle">{escape(title)}</text>')
    print('  <g font-family="DejaVu Sans Mono, Menlo, Consolas, monospace" font-size="12.5" fill="#e6edf3">')
    print("\n".join(line_svg(line, number) for number, line in enumerate(lines)))
    print("  </g>\n</svg>")


main()
