#!/usr/bin/env python3
"""The check of the pages on itself."""

import unittest

from pages import complaints, holds, outputs

SOURCE = "int main() {\n    if (true) {\n        sail();\n    }\n}\n"
SHOWN = "<!-- compile: skip: shown from a.cpp -->\n```cpp\n{}```\n"


def check(text, must_be_shown=True):
    return complaints("page.md", text, {"a.cpp": SOURCE, "b.md": ""}.get, must_be_shown)


class Pages(unittest.TestCase):
    def test_what_stands_in_the_file_may_be_shown(self):
        self.assertEqual(check(SHOWN.format(SOURCE)), [])
        self.assertEqual(check(SHOWN.format("if (true) {\n    sail();\n}\n")), [])

    def test_what_differs_is_refused(self):
        for code in ["if (true) {\n    row();\n}\n", "if (true) {\nsail();\n}\n", "int main() {\n}\n"]:
            self.assertEqual(len(check(SHOWN.format(code))), 1, code)
        self.assertEqual(len(check(SHOWN.replace("a.cpp", "gone.cpp").format(SOURCE))), 1)

    def test_the_tutorial_shows_nothing_that_is_not_compiled(self):
        self.assertEqual(len(check("```cpp\nint x;\n```\n")), 1)
        self.assertEqual(check("```cpp\nint x;\n```\n", must_be_shown=False), [])

    def test_links(self):
        self.assertEqual(check("[b](b.md) [c](b.md#part) [d](https://example.org/) [e](#here)\n"), [])
        self.assertEqual(len(check("[b](gone.md)\n")), 1)
        self.assertEqual(check("```sh\n[b](gone.md)\n```\n"), [])

    def test_outputs(self):
        page = "<!-- output of one -->\n```text\na\nb\n```\n<!-- output of two x, beside y -->\n```text\nc\n```\n"
        self.assertEqual(outputs(page), {"one": ("", "", "a\nb\n"), "two": ("x", "y", "c\n")})

    def test_a_piece_must_stand_together(self):
        self.assertFalse(holds("a\nb\nc\n", "a\nc\n"))


if __name__ == "__main__":
    unittest.main()
