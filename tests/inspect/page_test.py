#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""Opens pages of `vellum inspect` in Chromium and uses them as people do. Ends with 77 where there is no Chromium.

usage: page_test.py VELLUM [NAME OF A TEST]...
"""
import pathlib
import subprocess
import sys
import tempfile
import unittest

sys.dont_write_bytecode = True
import made_up  # noqa: E402
from browser import Browser, find_chromium  # noqa: E402

VELLUM = ""
COLUMNS = 6
MESH = 'leaf </script><script>document.title="broken"</script> "é" 葉'
READY = "document.getElementById('canvas').dataset.ready === 'true'"


def text(selector):
    return f"document.querySelector({selector!r}).textContent"


class PageTest(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.folder = tempfile.TemporaryDirectory()
        folder = pathlib.Path(cls.folder.name)
        (folder / 'a <i>"b" é.glb').write_bytes(made_up.glb([
            (MESH, "first & <b>", made_up.disc(256), COLUMNS), ("", "second", made_up.holes(64), 4)]))
        cls.page = folder / "page.html"
        subprocess.run([VELLUM, "inspect", folder / 'a <i>"b" é.glb', "--bake", "--html", cls.page], check=True,
                       stdout=subprocess.DEVNULL)
        cls.browser = Browser(find_chromium())

    @classmethod
    def tearDownClass(cls):
        cls.browser.__exit__()
        cls.folder.cleanup()

    def setUp(self):
        self.browser.console.clear()
        self.browser.requests.clear()
        self.browser.prefer("light")
        self.browser.resize(1280, 900)
        self.browser.open(self.page)
        self.value = self.browser.evaluate
        self.value("document.getElementById('work').scrollIntoView()")
        self.settle()

    def tearDown(self):
        self.assertEqual(self.browser.console, [])
        others = [url for url in self.browser.requests if not url.startswith(("data:", "file:"))]
        self.assertEqual(others, [])
        self.assertLessEqual(len([url for url in self.browser.requests if url.startswith("file:")]), 2)

    def canvas_box(self):
        return self.value("(() => { const r = document.getElementById('canvas').getBoundingClientRect();"
                          "return [r.left, r.top, r.width, r.height]; })()")

    def place(self, u, v):
        """Where a point of the unit square is on the screen, as long as the picture shows everything."""
        left, top, width, height = self.canvas_box()
        scale = min(width, height) / 1.1
        return left + width / 2 + (u - 0.5) * scale, top + height / 2 + (v - 0.5) * scale

    def details(self):
        terms = self.value("[...document.querySelectorAll('#details dt')].map((t) => "
                           "[t.textContent, t.nextSibling.textContent])")
        return dict(terms)

    def zoom(self):
        return float(self.value(text("#zoom")).rstrip(" %"))

    def pixel(self, u, v):
        """Of the canvas."""
        x, y = self.place(u, v)
        left, top, *_ = self.canvas_box()
        # The pixel is copied to another canvas first: Chromium warns about reading from one that is drawn to.
        return self.value(f"""(() => {{
            const pixel = new OffscreenCanvas(1, 1).getContext("2d", {{ willReadFrequently: true }});
            pixel.drawImage(document.getElementById("canvas"), {-round(x - left)}, {-round(y - top)});
            return [...pixel.getImageData(0, 0, 1, 1).data]; }})()""")

    def settle(self):
        """Waits until changes are drawn: a frame, and the tiles that it requests."""
        self.value("new Promise((done) => requestAnimationFrame(() => requestAnimationFrame(done)))")
        self.browser.wait_for(READY)

    def key(self, key):
        self.browser.key(key)
        self.settle()

    def point(self, x, y):
        self.browser.mouse("mouseMoved", x, y)
        self.settle()

    def test_text_of_the_file_stays_text(self):
        self.assertEqual(self.value("document.title"), 'a <i>"b" é.glb – opacity micromaps')
        self.assertEqual(self.value(text("#name")), 'a <i>"b" é.glb')
        self.assertEqual(self.value(text("figcaption")).split("</script>")[0], "leaf ")
        self.assertIn("葉", self.value(text("#primitives tbody button")))
        self.assertEqual(self.value(text("[role=tab]")), "first & <b>")

    def test_numbers(self):
        self.assertIn("104", self.value(text("#tiles")))
        shares = self.value("[...document.querySelectorAll('#cards .card:first-child tbody tr')]"
                            ".map((r) => parseFloat(r.cells[1].textContent))")
        self.assertAlmostEqual(sum(shares), 100, delta=0.3)

    def test_hover_shows_the_triangle(self):
        for row, column, upper in ((0, 0, False), (2, 3, True), (5, 1, False), (4, 4, True)):
            u = (column + (0.7 if upper else 0.3)) / COLUMNS
            v = (row + (0.7 if upper else 0.3)) / COLUMNS
            self.point(*self.place(u, v))
            number = 2 * (row * COLUMNS + column) + upper
            self.assertEqual(self.details()["Triangle"], str(number))
            self.assertTrue(self.details()["Mesh"].startswith("0 leaf </script>"))
            self.assertIn(f"tri {number}:", self.value(text("#tip")))
        self.point(*self.place(0.5, -0.03))
        self.assertEqual(self.details(), {})

    def test_hover_tells_the_state(self):
        self.point(*self.place(0.51, 0.48))
        self.assertTrue(self.value(text("#tip")).endswith(": opaque"))
        self.point(*self.place(0.03, 0.02))
        self.assertTrue(self.value(text("#tip")).endswith(": transparent"))

    def test_states_have_their_colours(self):
        self.value("document.getElementById('strength').value = 100;"
                   "document.getElementById('strength').dispatchEvent(new Event('input'))")
        self.settle()
        self.assertEqual(self.pixel(0.53, 0.49)[:3], [0x00, 0x72, 0xb2])
        self.assertEqual(self.pixel(0.03, 0.02)[:3], [0x56, 0xb4, 0xe9])
        self.value("document.querySelector('#legend button').click()")  # opaque ones are not shown any more
        self.settle()
        red, green, blue, _ = self.pixel(0.53, 0.49)
        self.assertLess(max(red, green, blue) - min(red, green, blue), 3, "the grey texture")

    def test_the_worst_are_one_click_away(self):
        before = self.zoom()
        entry = "#worst button"
        name = self.value(text(entry + " .who"))
        box = self.value(f"(() => {{ const r = document.querySelector('{entry}').getBoundingClientRect();"
                         "return [r.left + 20, r.top + 8]; })()")
        self.browser.click(*box)
        self.settle()
        self.assertGreater(self.zoom(), 2 * before)
        self.assertEqual(self.value(text("#details-title")), "Pinned triangle")
        self.assertIn(f"tri {self.details()['Triangle'].split()[0]}", name)
        self.assertEqual(self.value(f"document.querySelector('{entry}').getAttribute('aria-current')"), "true")
        self.assertEqual(self.value("document.activeElement.id"), "canvas")
        self.value("document.getElementById('by-bytes').click()")
        self.assertIn("known", self.value(text(entry)))

    def test_keyboard(self):
        self.value("document.getElementById('canvas').focus()")
        before = self.zoom()
        self.key("+")
        self.assertAlmostEqual(self.zoom(), 1.4 * before, delta=1)
        at_middle = self.details()["Triangle"]
        for _ in range(3):
            self.key("ArrowRight")
        self.assertNotEqual(self.details().get("Triangle"), at_middle)
        self.key("-")
        self.key("0")
        self.assertAlmostEqual(self.zoom(), before, delta=1)
        self.key("Enter")
        self.assertEqual(self.value(text("#details-title")), "Pinned triangle")
        pinned = int(self.details()["Triangle"])
        self.key("n")
        self.assertEqual(int(self.details()["Triangle"]), pinned + 1)
        self.key("p")
        self.assertEqual(int(self.details()["Triangle"]), pinned)
        self.key("Escape")
        self.assertEqual(self.value(text("#details-title")), "Triangle")

    def test_focus_is_visible(self):
        self.value("document.getElementById('theme').focus()")
        seen = set()
        for _ in range(40):
            self.browser.key("Tab", 9)
            found = self.value("(() => { const e = document.activeElement; const s = getComputedStyle(e);"
                               "return [e.id || e.textContent.slice(0, 30), s.outlineStyle, s.outlineWidth]; })()")
            if found[0] in seen or found[0] == "":
                break
            seen.add(found[0])
            self.assertNotEqual(found[1], "none", found[0])
        self.assertTrue({"zoom-in", "canvas", "strength", "by-area"} <= seen, seen)

    def test_everything_has_a_name(self):
        nameless = self.value("[...document.querySelectorAll('button, select, input, canvas, img')].filter((e) =>"
                              "!(e.textContent.trim() || e.getAttribute('aria-label') || e.alt || e.labels?.length))"
                              ".map((e) => e.outerHTML)")
        self.assertEqual(nameless, [])

    def test_materials_are_tabs(self):
        label = self.value("document.getElementById('canvas').getAttribute('aria-label')")
        self.assertIn("first & <b>", label)
        self.value("document.querySelector('[role=tab]').focus()")
        self.browser.key("ArrowRight", 39)
        self.settle()
        self.assertIn("second, 32 triangles", self.value("document.getElementById('canvas').getAttribute('aria-label')"))
        self.point(*self.place(0.9, 0.1))
        self.assertEqual(self.details()["Mesh"], "1")

    def test_wheel_and_drag(self):
        x, y = self.place(0.3, 0.6)
        self.point(x, y)
        under = self.details()["Triangle"]
        before = self.zoom()
        self.browser.mouse("mouseWheel", x, y, deltaX=0, deltaY=-300)
        self.browser.wait_for(f"parseFloat({text('#zoom')}) > {1.5 * before}")
        self.point(x + 1, y)
        self.assertEqual(self.details()["Triangle"], under, "what is under the pointer stays there")
        self.browser.mouse("mousePressed", x, y, button="left", clickCount=1)
        self.browser.mouse("mouseMoved", x + 40, y + 30, button="left", buttons=1)
        self.browser.mouse("mouseReleased", x + 40, y + 30, button="left", clickCount=1)
        self.settle()
        self.point(x + 41, y + 30)
        self.assertEqual(self.details()["Triangle"], under, "it moves with the pointer")
        self.assertEqual(self.value(text("#details-title")), "Triangle", "a drag pins nothing")

    def test_light_and_dark(self):
        ground = "getComputedStyle(document.documentElement).backgroundColor"
        light = self.value(ground)
        self.browser.prefer("dark")
        self.settle()
        dark = self.value(ground)
        self.assertNotEqual(light, dark)
        self.value("document.getElementById('theme').click()")
        self.assertEqual(self.value(ground), light)
        self.browser.prefer("light")
        self.settle()
        self.value("document.getElementById('theme').click()")
        self.assertEqual(self.value(ground), dark)

    def test_small_screens(self):
        self.browser.resize(360, 700, mobile=True)
        self.settle()
        self.assertLessEqual(self.value("document.documentElement.scrollWidth"), 360)
        self.assertLessEqual(self.canvas_box()[2], 360)

    def test_a_hundred_thousand_triangles(self):
        folder = pathlib.Path(self.folder.name)
        (folder / "large.glb").write_bytes(made_up.glb([("many", "leaves", made_up.holes(256), 224)]))
        page = folder / "large.html"
        subprocess.run([VELLUM, "inspect", folder / "large.glb", "--bake", "--html", page], check=True,
                       stdout=subprocess.DEVNULL)
        self.assertLess(page.stat().st_size, 4_000_000)
        self.browser.open(page)
        self.value("document.getElementById('work').scrollIntoView()")
        self.assertLess(self.value("document.querySelectorAll('*').length"), 2000)
        self.point(*self.place(100.3 / 224, 50.3 / 224))
        self.assertEqual(self.details()["Triangle"], f"{2 * (50 * 224 + 100):,}")


def main():
    global VELLUM
    VELLUM = sys.argv.pop(1)
    if find_chromium() is None:
        print("skipped: there is no chromium; scripts/setup installs it")
        return 77
    return 0 if unittest.main(exit=False, verbosity=2).result.wasSuccessful() else 1


if __name__ == "__main__":
    sys.exit(main())
