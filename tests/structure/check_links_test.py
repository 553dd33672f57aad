#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""Tests check_links.py on trees that are made up, each with one dead link."""
import pathlib
import subprocess
import sys
import tempfile
import unittest

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parent))
import check_includes  # noqa: E402

CHECK = pathlib.Path(__file__).resolve().with_name("check_links.py")
FILES = {
    "README.md": "[page](docs/page.md), [part](docs/page.md#a-part-of-it), [web](https://example.org), `[code](none)`, `VELLUM-one`\n"
                 "```\n# comment\n[code](none)\n```\n",
    "docs/page.md": "# Page of `code.cpp` and `src/code.cpp`\n[back](../README.md) [down](#same-1)\n## A part: of [it](page.md)\n## Same\n## Same\n",
    "docs/messages.md": "`VELLUM-one`\n",
    "src/code.cpp": "// docs/page.md has it.\n",
}


def run(name="", old="", new=""):
    with tempfile.TemporaryDirectory() as folder:
        for file, text in FILES.items():
            path = pathlib.Path(folder, file)
            path.parent.mkdir(parents=True, exist_ok=True)
            path.write_text(text.replace(old, new) if file == name else text, encoding="utf-8")
        result = subprocess.run([sys.executable, str(CHECK), folder], stdout=subprocess.PIPE, text=True, check=False)
    return result.returncode, result.stdout


class CheckLinks(unittest.TestCase):
    def expect_finding(self, expected, *change):
        code, out = run(*change)
        self.assertEqual(code, 1, out)
        self.assertEqual(len(out.splitlines()), 2, out)
        self.assertIn(expected, out)

    def test_sound(self):
        self.assertEqual(run(), (0, "\n0 findings in 3 documents\n"))

    def test_file(self):
        self.expect_finding("docs/page.md: there is no ../READ.md", "docs/page.md", "README", "READ")

    def test_heading(self):
        self.expect_finding("README.md: docs/page.md has no heading #a-part-of-it", "docs/page.md", "A part", "Part")
        self.expect_finding("docs/page.md: docs/page.md has no heading #same-1", "docs/page.md", "## Same\n## Same", "## Same")

    def test_source(self):
        self.expect_finding("docs/page.md: there is no file src/codes.cpp", "docs/page.md", "src/code.", "src/codes.")
        self.expect_finding("docs/page.md: there is no file ode.cpp", "docs/page.md", "`code", "`ode")

    def test_folder(self):
        row = "\n| `src/%s` | `code.cpp` |\n"
        change = "docs/page.md", "\n## Same\n"
        self.assertEqual(run(*change, row.replace("/%s", "") + "## Same\n")[0], 0)
        self.expect_finding("docs/page.md: there is no file code.cpp in src/bake", *change, row % "bake" + "## Same\n")

    def test_message(self):
        self.expect_finding("README.md: docs/messages.md has no VELLUM-two", "README.md", "VELLUM-one", "VELLUM-two")

    def test_diagram(self):
        layer = check_includes.SUBSYSTEMS["layer"]
        FILES["docs/design/map.md"] = "".join(f"  {name} --> {below}\n" for name in layer for below in layer[name])
        self.addCleanup(FILES.pop, "docs/design/map.md")
        self.assertEqual(run()[0], 0)
        second = list(layer)[1] # reaches the first only
        self.expect_finding(f"docs/design/map.md: {second} reaches []", "docs/design/map.md", f"  {second} --> base\n", "")

    def test_comment(self):
        self.expect_finding("code.cpp: there is no docs/pages.md", "src/code.cpp", "page", "pages")


if __name__ == "__main__":
    unittest.main()
