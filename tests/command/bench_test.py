#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""Runs `vellum bench` for a second: its report is complete and by the schema, and its page can be read in Chromium, light and
dark, on a narrow screen and printed. Without Chromium the page is not opened. Drivers that hang, die or lose the device, and
Ctrl-C, leave a report of what was measured.

usage: bench_test.py VELLUM SCHEMA LAYERS        LAYERS: the folder of the faulty driver's manifest
"""
import base64
import concurrent.futures
import json
import os
import pathlib
import re
import signal
import subprocess
import sys
import tempfile
import time
import unittest

sys.dont_write_bytecode = True
sys.path.insert(0, str(pathlib.Path(__file__).resolve().parent.parent / "inspect"))
from browser import Browser, find_chromium  # noqa: E402
from schema import faults, strict  # noqa: E402

VELLUM, SCHEMA, LAYERS = sys.argv[1], strict(json.loads(pathlib.Path(sys.argv[2]).read_text(encoding="utf-8"))), sys.argv[3]


# Elements that are wider than their box and do not scroll, or that lie outside the page or their picture.
CUT_OFF = """(() => {
  const right = document.documentElement.clientWidth;
  const outside = (inner, outer) => inner.left < outer.left - 0.5 || inner.right > outer.right + 0.5;
  return [...document.body.querySelectorAll("*")].filter((element) => {
    const box = element.getBoundingClientRect();
    if (box.width === 0) return false;
    const picture = element.ownerSVGElement;
    return outside(box, picture ? picture.getBoundingClientRect() : { left: 0, right }) ||
      (!picture && getComputedStyle(element).display !== "inline" && element.scrollWidth > element.clientWidth);
  }).map((element) => element.tagName + ": " + element.textContent.slice(0, 60));
})()"""


class BenchTest(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.folder = tempfile.TemporaryDirectory()
        cls.page = pathlib.Path(cls.folder.name) / "bench.html"
        # Times of a fraction of a second mean nothing, but every part has rows.
        cls.printed = subprocess.run([VELLUM, "bench", "--seconds", "1", "--timeout", "600", "-o", cls.page,
                                      "--device", "llvm"], check=True, stdout=subprocess.PIPE, text=True, timeout=1200,
                                     env={**os.environ, "ASAN_OPTIONS": "detect_leaks=0"}).stdout
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
        self.assertTrue(self.printed.startswith(f"Device: {device['name']}\n"), self.printed)
        self.assertGreater(device["limits"]["maxInstanceCount"], 0)
        for frame in self.rows("frame"):
            self.assertEqual(frame["differingPixels"], 0)
            self.assertGreater(frame["micromapBytes"], 0)
            self.assertLess(frame["candidatesPerRay"][1], frame["candidatesPerRay"][0])
            self.assertLessEqual(frame["ratio"][0], frame["ratio"][2])
        self.assertEqual({frame["level"] for frame in self.rows("frame")}, {3, 5, 7})
        self.assertTrue(all(row["failed"] == 0 and row["passed"] > 0 for row in self.rows("check")))
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
            self.assertEqual(browser.evaluate("document.querySelector('h1').textContent"),
                         "Opacity micromaps on " + device["name"])
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
            browser.evaluate("document.querySelectorAll('details').forEach(details => { details.open = true; })")
            for width in (320, 360, 499):
                browser.resize(width, 800)
                self.assertEqual(browser.evaluate(CUT_OFF), [], width)
            self.assertEqual(browser.evaluate("getComputedStyle(document.querySelector('#run td:last-child'), '::before').content"),
                             '"result"')
            browser.evaluate("document.querySelectorAll('details').forEach(details => { details.open = false; })")

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


class IncompleteTest(unittest.TestCase):
    def setUp(self):
        folder = tempfile.TemporaryDirectory()
        self.addCleanup(folder.cleanup)
        self.folder = pathlib.Path(folder.name)

    def start(self, fault, timeout):
        environment = os.environ | {"VK_INSTANCE_LAYERS": "VK_LAYER_VELLUM_test_faulty_driver",
                                    "VK_ADD_LAYER_PATH": LAYERS, "VELLUM_TEST_FAULT": fault,
                                    "VELLUM_TEST_FAULT_AFTER": "0"}
        return subprocess.Popen([VELLUM, "bench", "--seconds", "1", "--timeout", str(timeout), "-o",
                                 self.folder / f"{fault}.html"],
                                env=environment, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, text=True)

    # The parts after the first, which describes the device.
    def parts(self, fault, printed):
        page = self.folder / f"{fault}.html"
        self.assertIn("<html", page.read_text(encoding="utf-8"))
        report = json.loads(page.with_suffix(".json").read_text(encoding="utf-8"))
        self.assertEqual(faults(report, SCHEMA), [])
        device, *others = report["parts"]
        self.assertEqual(device["failure"], "")
        for part in others:
            if part["failure"]:
                self.assertIn(f"The part {part['name']} was not completed: {part['failure']}.", printed)
        return others

    def run_with(self, fault, timeout):
        process = self.start(fault, timeout)
        printed, _ = process.communicate(timeout=1200)
        self.assertEqual(process.returncode, 1)
        parts = self.parts(fault, printed)
        self.assertEqual(len(parts), 5)
        return parts

    # Side by side: most of the time is spent waiting for what hangs.
    def test_faulty_drivers(self):
        with concurrent.futures.ThreadPoolExecutor(3) as pool:
            hung, dead, lost = pool.map(self.run_with, ("hangs", "dies", "loses-device"), (8, 600, 600))
        for part in hung:
            self.assertEqual(part["failure"], "hung: no progress for 8 seconds")
        for part in dead:
            self.assertRegex(part["failure"], "^crashed: .*SIGABRT")
        check, *others = lost
        self.assertEqual(check["rows"][0]["passed"], 0)
        self.assertGreater(check["rows"][0]["failed"], 0)
        for part in others:
            self.assertRegex(part["failure"], "the device was lost$")

    def test_interrupted(self):
        process = self.start("hangs", 600)
        children = pathlib.Path(f"/proc/{process.pid}/task/{process.pid}/children")

        def checks():
            try:
                return any(b"check" in pathlib.Path(f"/proc/{child}/cmdline").read_bytes().split(b"\0")
                           for child in children.read_text().split())
            except (FileNotFoundError, ProcessLookupError):  # a child has ended meanwhile
                return False

        while not checks():
            self.assertIsNone(process.poll())
            time.sleep(0.1)
        process.send_signal(signal.SIGINT)
        printed, _ = process.communicate(timeout=600)
        self.assertEqual(process.returncode, -signal.SIGINT)
        self.assertEqual([part["failure"] for part in self.parts("hangs", printed)], ["interrupted"])


if __name__ == "__main__":
    unittest.main(argv=sys.argv[:1])
