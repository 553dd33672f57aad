#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""Runs `vellum bench` for a second: its report is complete and by the schema, and its page can be read in Chromium, light and
dark, on a narrow screen and printed. Without Chromium the page is not opened.

usage: bench_test.py VELLUM SCHEMA
"""
import base64
import json
import pathlib
import re
import subprocess
import sys
import tempfile
import unittest

sys.dont_write_bytecode = True
sys.path.insert(0, str(pathlib.Path(__file__).resolve().parent.parent / "inspect"))
from browser import Browser, find_chromium  # noqa: E402
from schema import faults  # noqa: E402

VELLUM, SCHEMA = sys.argv[1], json.loads(pathlib.Path(sys.argv[2]).read_text(encoding="utf-8"))


class BenchTest(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.folder = tempfile.TemporaryDirectory()
        cls.page = pathlib.Path(cls.folder.name) / "bench.html"
        # Times of a fraction of a second mean nothing, but every part has rows.
        subprocess.run([VELLUM, "bench", "--seconds", "1", "--timeout", "600", "-o", cls.page], check=True,
                       stdout=subprocess.DEVNULL, timeout=1200)
        cls.report = json.loads(cls.page.with_suffix(".json").read_text(encoding="utf-8"))

    @classmethod
    def tearDownClass(cls):
        cls.folder.cleanup()

    def rows(self, kind):
        return [row for part in self.report["parts"] for row in part["rows"] if row["row"] == kind]

    def test_report(self):
        self.assertEqual(faults(self.report, SCHEMA), [])
        for part in self.report["parts"]:
            self.assertTrue(part["rows"] and not part["failure"], part)
        device, = self.rows("device")
        members = {name: value for name, value in device.items() if name != "row"}
        self.assertEqual(faults(members, SCHEMA["$defs"]["device"], whole=SCHEMA), [])
        self.assertIn("VK_KHR_ray_query", device["extensions"])
        self.assertGreater(device["limits"]["maxInstanceCount"], 0)
        for frame in self.rows("frame"):
            self.assertEqual(frame["differingPixels"], 0)
            self.assertGreater(frame["micromapBytes"], 0)
            self.assertLess(frame["candidatesPerRay"][1], frame["candidatesPerRay"][0])
            self.assertLessEqual(frame["ratio"][0], frame["ratio"][2])
        self.assertEqual({frame["level"] for frame in self.rows("frame")}, {3, 5, 7})
        self.assertTrue(all(row["failed"] == 0 for row in self.rows("check")))
        self.assertTrue(all(row["triangles"] >= 512 for row in self.rows("micromap")))

    def test_nothing_private(self):
        for path in (self.page, self.page.with_suffix(".json")):
            text = path.read_text(encoding="utf-8")
            for word in ("<!--@", self.folder.name, str(pathlib.Path.home()) + "/", "/home/", "/usr/"):
                self.assertNotIn(word, text)

    @unittest.skipUnless(find_chromium(), "there is no chromium; scripts/setup installs it")
    def test_page(self):
        with Browser(find_chromium()) as browser:
            browser.call("Page.navigate", url=self.page.as_uri())
            browser.wait_for("document.querySelector('#verdict li') !== null")
            device, = self.rows("device")
            self.assertEqual(browser.evaluate("document.querySelector('h1').textContent"), device["name"])
            self.assertEqual(browser.evaluate("document.querySelectorAll('section[hidden]').length"), 0)
            charts = len({part["name"] for part in self.report["parts"] if part["name"].startswith("frames")})
            self.assertEqual(browser.evaluate("document.querySelectorAll('svg').length"), charts)
            self.assertEqual(browser.evaluate("document.querySelectorAll('svg circle').length"), len(self.rows("frame")))
            self.assertNotRegex(browser.evaluate("document.body.innerText"), r"undefined|NaN|null")

            back = "getComputedStyle(document.body).backgroundColor"
            light = browser.evaluate(back)
            browser.prefer("dark")
            self.assertNotEqual(browser.evaluate(back), light)
            browser.prefer("light")
            browser.resize(360, 800)
            self.assertLessEqual(browser.evaluate("document.documentElement.scrollWidth"), 360)

            # Tables that are wider than the paper would lose their last columns.
            browser.call("Emulation.setEmulatedMedia", media="print")
            browser.resize(718, 1000) # A4 at 96 dpi, without its margins
            self.assertEqual(browser.evaluate(
                "[...document.querySelectorAll('.scroll')].filter(box => box.offsetParent && "
                "box.scrollWidth > box.clientWidth).map(box => box.innerText)"), [])
            paper = base64.b64decode(browser.call("Page.printToPDF")["data"])
            self.assertTrue(paper.startswith(b"%PDF"))
            self.assertTrue(1 <= len(re.findall(rb"/Type\s*/Page\b", paper)) <= 6)
            self.assertEqual(browser.console, [])
            self.assertEqual([url for url in browser.requests if not url.startswith(("file:", "data:"))], [])


if __name__ == "__main__":
    unittest.main(argv=sys.argv[:1])
