#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""Uses vellum.html in Chromium as people do, and compares what it shows and makes with the command; then the npm package, which is
beside it in the folder `package`. Ends with 77 where there is no Chromium.

usage: page_test.py vellum.html VELLUM [--picture FILE] [NAME OF A TEST]...
       page_test.py vellum.html --bake IN.glb OUT.glb    no tests: a bake with automatic levels
  --picture FILE   also renders the picture of docs/browser.md
  VELLUM_MODELS    a folder of .glb files that are baked as well
"""
import base64
import functools
import hashlib
import http.server
import json
import os
import pathlib
import random
import re
import shlex
import shutil
import struct
import subprocess
import sys
import tempfile
import threading
import time
import unittest
import zlib

sys.dont_write_bytecode = True
ROOT = pathlib.Path(__file__).resolve().parents[3]
sys.path.insert(0, str(ROOT / "tests/inspect"))
import made_up  # noqa: E402
from browser import Browser, find_chromium  # noqa: E402

PAGE, VELLUM, PICTURE = "", "", None
IDLE = "document.getElementById('work').hidden"
# Text whose contrast with what is behind it is less than WCAG's 4.5.
PALE = """(() => {
  const canvas = new OffscreenCanvas(1, 1).getContext("2d", { willReadFrequently: true });
  const rgba = (color) => { canvas.clearRect(0, 0, 1, 1); canvas.fillStyle = color; canvas.fillRect(0, 0, 1, 1);
    return [...canvas.getImageData(0, 0, 1, 1).data]; };
  const behind = (e) => { for (; e; e = e.parentElement) { const c = rgba(getComputedStyle(e).backgroundColor);
    if (c[3] === 255) return c; } return [255, 255, 255, 255]; };
  const light = (c) => [0.2126, 0.7152, 0.0722].reduce((sum, factor, i) =>
    sum + factor * (c[i] > 10 ? ((c[i] / 255 + 0.055) / 1.055) ** 2.4 : c[i] / 255 / 12.92), 0);
  return [...document.querySelectorAll("body *")].filter((e) => e.checkVisibility() && !e.closest(":disabled") &&
    [...e.childNodes].some((n) => n.nodeType === 3 && n.data.trim())).map((e) => {
      const [a, b] = [light(rgba(getComputedStyle(e).color)), light(behind(e))];
      return [(Math.max(a, b) + 0.05) / (Math.min(a, b) + 0.05), e.textContent.slice(0, 40)];
    }).filter(([contrast]) => contrast < 4.5); })()"""


def vellum(*words):
    done = subprocess.run([VELLUM, *map(str, words)], check=True, capture_output=True)
    return done.stdout


def glb(document, binary=b""):
    text = json.dumps(document).encode()
    text += b" " * (-len(text) % 4)
    binary += b"\0" * (-len(binary) % 4)
    return (struct.pack("<4sII", b"glTF", 2, 28 + len(text) + len(binary)) + struct.pack("<I4s", len(text), b"JSON") + text +
            struct.pack("<I4s", len(binary), b"BIN\0") + binary)


def parts(path):
    """The JSON and the binary chunk of a .glb."""
    data = path.read_bytes()
    size, = struct.unpack_from("<I", data, 12)
    return json.loads(data[20:20 + size]), data[28 + size:]


def leaves(columns=6, edge=64):
    return made_up.glb([("leaves", "leaf", made_up.disc(edge), columns), ("twigs", "twig", made_up.holes(32), 2)])


def pixels(uri):
    """The filtered pixels of a PNG, whatever their compression."""
    data, at, image = base64.b64decode(uri.split(",")[1]), 8, b""
    while at < len(data):
        length, kind = struct.unpack_from(">I4s", data, at)
        image += data[at + 8:at + 8 + length] if kind == b"IDAT" else b""
        at += 12 + length
    return zlib.decompress(image)


def content(page):
    """What a page of `vellum inspect` shows, without how it is compressed."""
    text = page.read_text(encoding="utf-8")
    facts = json.loads(re.search(r'id="facts">(.*?)</script>', text, re.S)[1])
    numbers = re.search(r'id="numbers">(.*?)</script>', text, re.S)[1]
    for each in facts["materials"] + facts["meshes"]:
        for key in ("texture", "picture"):
            if key in each:
                each[key] = zlib.crc32(pixels(each[key]))
    rest = re.sub(r'id="(facts|numbers)">.*?</script>', "", text, flags=re.S)
    return facts, zlib.decompress(base64.b64decode(numbers)), rest


class QuietHandler(http.server.SimpleHTTPRequestHandler):
    def log_message(self, *_):
        pass


class Page(Browser):
    """The page in a browser. Downloads go to a folder."""

    def __init__(self, downloads):
        super().__init__(find_chromium(), 1100, 900)
        self.downloads = downloads
        session, self.session = self.session, None
        self.call("Browser.setDownloadBehavior", behavior="allow", downloadPath=str(downloads))
        self.session = session

    def open(self, path):
        self.call("Page.navigate", url=pathlib.Path(path).resolve().as_uri())
        self.wait_for("document.documentElement?.dataset.ready === 'true'")

    def text(self, name):
        return self.evaluate(f"document.getElementById({name!r}).textContent")

    def shown(self, name):
        return self.evaluate(f"document.getElementById({name!r}).checkVisibility()")

    def wait(self, timeout=120):
        self.wait_for(IDLE, timeout)

    def choose(self, *paths, name="files"):
        root = self.call("DOM.getDocument")["root"]["nodeId"]
        node = self.call("DOM.querySelector", nodeId=root, selector=f"#{name}")["nodeId"]
        self.call("DOM.setFileInputFiles", nodeId=node, files=[str(path) for path in paths])
        # The event reaches the page before the answer reaches this test, but reading begins later.
        self.wait_for("new Promise((done) => setTimeout(() => done(true)))")
        self.wait()

    def drop(self, *paths):
        data = {"items": [], "files": [str(path) for path in paths], "dragOperationsMask": 1}
        self.evaluate("(document.getElementById('settings').hidden = true, document.getElementById('messages').replaceChildren())")
        for kind in ("dragEnter", "dragOver", "drop"):
            self.call("Input.dispatchDragEvent", type=kind, x=300, y=160, data=data)
        self.wait_for(f"{IDLE} && (document.getElementById('messages').textContent !== '' || "
                      "document.getElementById('settings').checkVisibility())")

    def set_highest_level(self, level):
        self.evaluate(f"(() => {{ const e = document.getElementById('max-level'); e.value = {level};"
                      "e.dispatchEvent(new Event('change')); })()")

    def click(self, name):
        self.evaluate(f"document.getElementById({name!r}).click()")
        self.wait()

    def download(self, name):
        for path in self.downloads.iterdir():
            path.unlink()
        self.evaluate(f"document.getElementById({name!r}).click()")
        target = self.downloads / self.evaluate(f"document.getElementById({name!r}).download")
        end = time.monotonic() + 60
        while not target.exists() or list(self.downloads.glob("*.crdownload")):
            if time.monotonic() > end:
                raise RuntimeError("the download never ends")
            time.sleep(0.02)
        return target


class PageTest(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.temporary = tempfile.TemporaryDirectory()
        cls.folder = pathlib.Path(cls.temporary.name)
        cls.tree = cls.folder / "tree.glb"
        subprocess.run([sys.executable, ROOT / "examples/python/tree.py", cls.tree], check=True, stdout=subprocess.DEVNULL)
        cls.downloads = cls.folder / "downloads"
        cls.downloads.mkdir()
        cls.browser = Page(cls.downloads)
        cls.value = staticmethod(cls.browser.evaluate)

    @classmethod
    def tearDownClass(cls):
        cls.browser.__exit__()
        cls.temporary.cleanup()

    def setUp(self):
        self.browser.console.clear()
        self.browser.requests.clear()
        self.browser.prefer("light")
        self.browser.resize(1100, 900)
        self.browser.open(PAGE)

    def tearDown(self):
        self.assertEqual(self.browser.console, [])
        others = [url for url in self.browser.requests if not url.startswith(("data:", "blob:", "file:"))]
        self.assertEqual(others, [])
        self.assertLessEqual(len([url for url in self.browser.requests if url.startswith("file:")]), 2)

    def rows(self):
        """The table, by row: name, bytes, known, approximate, levels."""
        cells = self.value("[...document.querySelectorAll('#sweep tr:has(input)')]"
                           ".map((r) => [...r.cells].map((c) => c.textContent))")
        return [(name.replace(" recommended", ""), int(size.replace(",", "")), float(known.strip("< %")), approximate, levels)
                for name, size, known, _, approximate, levels in cells]

    def command(self):
        """The options of the command that the page shows."""
        return shlex.split(self.browser.text("command"))[3:]

    def check_bake(self, path, timeout=120):
        """Bakes as chosen; what is downloaded and drawn is what the command makes."""
        self.value("document.getElementById('bake').click()")
        self.browser.wait(timeout)
        self.assertEqual(self.browser.text("messages"), "")
        self.assertTrue(self.browser.shown("result"))
        self.assertEqual(self.browser.text("download"), f"Download {path.stem}.omm{path.suffix}")
        made = self.browser.download("download")
        expected = self.folder / "expected" / made.name
        expected.parent.mkdir(exist_ok=True)
        expected.write_bytes(vellum("bake", path, "-", "--quiet", *self.command()))
        self.assertEqual(made.read_bytes(), expected.read_bytes())
        return expected

    def check_sweep(self, path, *options):
        swept = json.loads(vellum("sweep", path, "--json", *options))
        rows = sorted(swept["rows"], key=lambda row: (row["budget"] is not None, row["states"] == 2))
        self.assertEqual([row[1] for row in self.rows()], [row["bytes"] for row in rows])
        for shown, row in zip(self.rows(), rows):
            self.assertAlmostEqual(shown[2], 100 * row["proven"], delta=0.0501)
        self.assertIn(swept["recommendation"]["reason"], self.browser.text("recommended"))
        self.assertEqual(" ".join(self.command()), swept["recommendation"]["options"])

    def test_models_are_baked_as_by_the_command(self):
        models = [self.tree, *sorted(pathlib.Path(os.environ.get("VELLUM_MODELS", "/nowhere")).glob("*.glb"))]
        for path in models:
            with self.subTest(path.name):
                self.browser.choose(path)
                self.assertEqual(self.browser.text("messages"), "")
                self.check_sweep(path)
                expected = self.check_bake(path)
                surface = json.loads(vellum("inspect", expected, "--json", "-q", "--html", self.folder / "page.html",
                                            "--force"))["files"][0]["surface"]
                self.assertIn(f"which know {100 * surface['known']:.1f} % of", self.browser.text("made"))
                # The page in the frame reports its height when everything is drawn.
                self.browser.wait_for("parseFloat(document.getElementById('inspect').style.height) > 1000")
                self.assertEqual(content(self.browser.download("save")), content(self.folder / "page.html"))

    def test_settings(self):
        self.browser.choose(self.tree)
        for number, options in ((4, ["--level", "4"]), (12, ["--level", "3", "--states", "2"]), (21, ["--budget", "8K"])):
            self.value(f"document.querySelectorAll('#sweep label')[{number}].click()")
            self.assertEqual(self.command(), options)
            self.assertEqual(self.rows()[number][0], {4: "Level 4", 12: "Level 3, 2 states", 21: "At most 8 KiB"}[number])
            self.check_bake(self.tree)
        self.browser.set_highest_level(5)
        self.browser.wait()
        self.assertFalse(self.browser.shown("result"))
        self.check_sweep(self.tree, "--max-level", "5")
        self.check_bake(self.tree)

    def test_blended_materials(self):
        document, binary = parts(self.tree)
        document["materials"][1]["alphaMode"] = "BLEND"
        path = self.folder / "it's blended.glb"
        path.write_bytes(glb(document, binary))
        self.browser.choose(path)
        self.assertIn("no primitive can get a micromap", self.browser.text("baked"))
        self.assertIn("its alphaMode is BLEND", self.browser.text("parts"))
        self.assertFalse(self.browser.shown("bake"))
        self.browser.click("blend")
        self.assertTrue(self.browser.shown("bake"))
        self.check_sweep(path, "--blend")
        self.assertEqual(shlex.split(self.browser.text("command"))[2], path.name)
        self.check_bake(path)

    def test_micromaps_that_are_there(self):
        path = self.folder / "baked.glb"
        path.write_bytes(vellum("bake", self.tree, "-", "-q", "--level", "3"))
        self.browser.choose(self.tree)
        self.assertFalse(self.browser.shown("existing"))
        self.browser.click("bake")
        self.assertTrue(self.value("document.getElementById('inspect').src"))
        self.browser.choose(path)
        # The result of the file before is released.
        self.assertFalse(self.value("document.getElementById('inspect').src || document.getElementById('download').href"))
        self.browser.click("existing")
        self.assertFalse(self.browser.shown("download"))
        vellum("inspect", path, "--html", self.folder / "page.html", "--force", "-q")
        self.assertEqual(content(self.browser.download("save")), content(self.folder / "page.html"))

    def test_a_gltf_with_its_files(self):
        document, binary = parts(self.tree)
        folder = self.folder / "model"
        (folder / "ima ges").mkdir(parents=True)
        image = document["images"][0]
        view = document["bufferViews"][image.pop("bufferView")]
        start = view.get("byteOffset", 0)
        (folder / "ima ges/leaf.100%").write_bytes(binary[start:start + view["byteLength"]])
        image.pop("mimeType", None)
        image["uri"], document["buffers"][0]["uri"] = "./ima%20ges/leaf.100%", "tree.bin"
        (folder / "tree.bin").write_bytes(binary)
        path = folder / "tree.gltf"
        path.write_text(json.dumps(document))
        (folder / "notes.txt").write_text("no model")
        # Only the files that the model names are read.
        self.value("(() => { window.read = []; const real = File.prototype.arrayBuffer; File.prototype.arrayBuffer = function () {"
                   "window.read.push(this.name); return real.call(this); }; })()")
        (folder / "other.bin").write_bytes(bytes(1000))
        self.browser.drop(folder)
        self.assertEqual(self.browser.text("messages"), "")
        self.assertEqual(self.value("window.read"), ["tree.gltf", "tree.bin", "leaf.100%"])
        self.check_sweep(path)
        self.check_bake(path)
        self.browser.choose(path)
        self.assertEqual(self.browser.text("messages"), "tree.gltf: buffer 0 (tree.bin): no such file. Drop the .gltf together "
                         "with the files that it names, or their folder.")
        self.assertFalse(self.browser.shown("settings"))
        self.browser.choose(path, folder / "tree.bin")
        self.assertIn("leaf.100%", self.browser.text("parts") + self.browser.text("messages"))
        (folder / "other.glb").write_bytes(leaves())
        self.browser.drop(folder)
        self.assertEqual(self.value("[...document.querySelectorAll('#messages button')].map((e) => e.textContent).sort()"),
                         ["model/other.glb", "model/tree.gltf"])
        self.value("[...document.querySelectorAll('#messages button')].find((e) => /tree/.test(e.textContent)).click()")
        self.browser.wait_for(f"{IDLE} && document.getElementById('settings').checkVisibility()")
        self.check_sweep(path)

    def test_hostile_files(self):
        good = self.tree.read_bytes()
        document, binary = parts(self.tree)
        huge = json.loads(json.dumps(document))
        for accessor in huge["accessors"]:
            accessor["count"] = 4_000_000_000
        far = json.loads(json.dumps(document))
        far["bufferViews"][0]["byteLength"] = 2 ** 53
        bad = {"text.glb": b"Dear glTF,\nI am a text.\n" * 50, "random.glb": random.Random(3).randbytes(100_000), "empty.glb": b"",
               "random.gltf": random.Random(4).randbytes(1000), "huge.glb": glb(huge, binary), "far.glb": glb(far, binary),
               "deep.gltf": b"[" * 200_000, "<b>.glb": b"glTF", "not.gltf": b"{}",
               **{f"cut{n}.glb": good[:n] for n in (4, 12, 19, 300, len(good) // 2, len(good) - 1)}}
        for name, data in bad.items():
            with self.subTest(name):
                (self.folder / name).write_bytes(data)
                self.browser.choose(self.folder / name)
                self.assertTrue(self.browser.text("messages").startswith(f"{name}: "), self.browser.text("messages"))
                self.assertFalse(self.browser.shown("settings"))
        (self.folder / "readme.txt").write_text("no model")
        self.browser.choose(self.folder / "readme.txt")
        self.assertEqual(self.browser.text("messages"), "readme.txt is not a glTF file; expected .glb or .gltf.")
        damaged = 0
        for seed in range(20):
            data, chance = bytearray(good), random.Random(seed)
            for _ in range(6):
                data[chance.randrange(20, 2000)] = chance.randrange(256)
            (self.folder / "damaged.glb").write_bytes(data)
            self.browser.choose(self.folder / "damaged.glb")
            self.assertNotEqual(bool(self.browser.text("messages")), self.browser.shown("settings"))
            damaged += bool(self.browser.text("messages"))
        self.assertGreater(damaged, 5)
        self.browser.choose(self.tree)
        self.check_bake(self.tree)

    def test_a_hundred_megabytes(self):
        document, binary = parts(self.tree)
        binary += b"\0" * (-len(binary) % 4)
        more = random.Random(5).randbytes(100_000_000)
        document["bufferViews"].append({"buffer": 0, "byteOffset": len(binary), "byteLength": len(more)})
        document["buffers"][0]["byteLength"] = len(binary) + len(more)
        path = self.folder / "large.glb"
        path.write_bytes(glb(document, binary + more))
        self.browser.choose(path)
        self.check_sweep(path)
        self.check_bake(path)
        path.unlink()

    def test_many_triangles(self):
        path = self.folder / "many.glb"
        path.write_bytes(made_up.glb([("many", "leaves", made_up.holes(256), 160)]))
        self.browser.choose(path)
        self.check_bake(path)
        # While the next comparison runs, there is progress, and it can be cancelled.
        self.browser.set_highest_level(12)
        self.assertTrue(self.browser.shown("cancel"))
        self.assertEqual(self.browser.text("doing"), "Comparing settings for many.glb")
        self.browser.wait_for("document.getElementById('progress').value > 0")
        self.assertFalse(self.value(IDLE))
        self.browser.click("cancel")
        self.assertEqual(self.browser.text("messages"), "Cancelled.")
        # What is shown are the settings that were compared before.
        self.assertEqual(self.value("document.getElementById('max-level').value"), "8")
        self.check_bake(path)
        self.browser.choose(self.tree)
        self.check_bake(self.tree)

    def test_a_first_comparison_that_is_cancelled(self):
        path = self.folder / "-first's.glb"
        path.write_bytes(made_up.glb([("many", "leaves", made_up.holes(256), 160)]))
        self.value("(() => { document.getElementById('max-level').value = 12; document.getElementById('folder').focus(); })()")
        self.value("""(() => { const [doing, cancel] = ["doing", "cancel"].map((id) => document.getElementById(id));
            window.watch = new MutationObserver(() => doing.textContent.startsWith("Comparing") &&
                setTimeout(() => { cancel.focus(); cancel.click(); }, 100));
            window.watch.observe(doing, { childList: true }); })()""")
        self.browser.choose(path)
        self.browser.wait()
        self.assertEqual(self.browser.text("messages"), "Cancelled.")
        self.assertEqual(self.value("document.activeElement.id"), "folder")
        shown = [self.browser.shown(name) for name in ("max-level", "blend", "sweep", "bake", "existing", "command", "parts")]
        self.assertEqual(shown, [True, True, False, False, False, False, False])
        self.value("window.watch.disconnect()")
        self.browser.set_highest_level(2)
        self.browser.wait()
        self.assertTrue(self.browser.text("command").startswith("vellum bake './-first'"))
        self.check_sweep(path, "--max-level", "2")

    def test_another_file_replaces_the_one_that_is_read(self):
        path = self.folder / "first.glb"
        path.write_bytes(made_up.glb([("many", "leaves", made_up.holes(256), 160)]))
        self.value("(() => { const e = document.getElementById('max-level'); e.value = 12; })()")
        root = self.browser.call("DOM.getDocument")["root"]["nodeId"]
        node = self.browser.call("DOM.querySelector", nodeId=root, selector="#files")["nodeId"]
        self.browser.call("DOM.setFileInputFiles", nodeId=node, files=[str(path)])
        self.browser.wait_for("document.getElementById('doing').textContent.startsWith('Comparing')")
        self.browser.choose(self.tree)
        self.assertEqual((self.browser.text("messages"), self.browser.text("settings-title")), ("", "tree.glb"))
        self.check_sweep(self.tree, "--max-level", "12")

    def test_drops_in_order_and_without_files(self):
        drop = """(handle) => document.dispatchEvent(Object.assign(new Event("drop"),
            { dataTransfer: { items: handle ? [{ kind: "file", getAsFileSystemHandle: handle }] : [] } }))"""
        message = "No file was found. Choose or drop a .glb or .gltf file."
        for handle in ("undefined", "async () => null", "async () => ({ kind: 'directory', name: 'empty', async *values() {} })"):
            self.value(f"(document.getElementById('messages').replaceChildren(), ({drop})({handle}), undefined)")
            self.browser.wait()
            self.assertEqual(self.browser.text("messages"), message, handle)
        # What is dropped on the frame of the result is for the page.
        over = "getComputedStyle(document.getElementById('inspect')).pointerEvents"
        leave = "Object.assign(new Event('dragleave'), { relatedTarget: null })"
        for event, expected in (("new Event('dragover')", "none"), (leave, "auto")):
            self.assertEqual(self.value(f"(document.dispatchEvent({event}), {over})"), expected)
        # A folder that is read slowly, and then another one: the latter counts.
        file = "{ kind: 'file', name: '%s.txt', getFile: async () => new File([], '%s.txt') }"
        late = f"() => new Promise((done) => {{ window.late = () => done({file % ('late', 'late')}); }})"
        self.value(f"(({drop})({late}), undefined)")
        self.assertEqual((self.browser.text("doing"), self.value(IDLE)), ("Reading the folder", False))
        self.value(f"(({drop})(async () => ({file % ('next', 'next')})), undefined)")
        self.browser.wait()
        self.value("(window.late(), new Promise((done) => setTimeout(done)))")
        self.assertEqual(self.browser.text("messages"), "next.txt is not a glTF file; expected .glb or .gltf.")

    def test_a_worker_that_fails_is_replaced(self):
        self.value("""(() => { const Real = Worker; window.Worker = function (...rest) {
            window.Worker = Real;
            const made = new Real(...rest);
            setTimeout(() => made.dispatchEvent(new ErrorEvent("error", { message: "it broke" })));
            return made; }; })()""")
        self.browser.choose(self.tree)
        self.assertEqual(self.browser.text("messages"), "tree.glb: this page failed (it broke).")
        self.browser.choose(self.tree)
        self.check_bake(self.tree)

    def test_a_picture_that_is_too_large(self):
        self.value("""(() => { const Real = Worker; window.Worker = function (...rest) {
            const made = new Real(...rest);
            const post = made.postMessage.bind(made);
            const error = { code: "VELLUM_ERROR_OUT_OF_MEMORY", message: "out of memory", own: true };
            made.postMessage = (message) => message.method !== "inspectPage" ? post(message) :
                made.dispatchEvent(new MessageEvent("message", { data: { id: message.id, error } }));
            return made; }; })()""")
        self.browser.choose(self.tree)
        self.browser.click("bake")
        self.assertEqual(self.browser.text("messages"), "The bake is done and can be downloaded; its picture needs more memory "
                         "than a page can have (4 GiB): use the command, vellum inspect.")
        self.assertEqual(self.browser.download("download").read_bytes(), vellum("bake", self.tree, "-", "-q", *self.command()))

    def test_a_cancelled_picture_leaves_the_result(self):
        self.browser.choose(self.tree)
        self.value("""new MutationObserver(() => document.getElementById("doing").textContent.startsWith("Drawing") &&
            document.getElementById("cancel").click()).observe(document.getElementById("doing"), { childList: true })""")
        self.browser.click("bake")
        self.assertEqual(self.browser.text("messages"), "Cancelled.")
        shown = [self.browser.shown(name) for name in ("result", "download", "inspect", "save")]
        self.assertEqual(shown, [True, True, False, False])
        self.assertEqual(self.browser.download("download").read_bytes(), vellum("bake", self.tree, "-", "-q", *self.command()))

    def test_keyboard(self):
        self.browser.choose(self.tree)
        self.value("document.activeElement.blur()")
        reached = []
        for _ in range(12):
            self.browser.key("Tab", 9)
            reached.append(self.value("(() => { const e = document.activeElement; return e.id || e.name || e.tagName; })()"))
            outline = self.value("""(() => { let e = document.activeElement;
                if (e.parentElement.matches('.button')) e = e.parentElement;
                return getComputedStyle(e).outlineStyle; })()""")
            self.assertNotEqual(outline, "none", reached)
            if reached[-1] == "bake":
                break
        self.assertEqual([each for each in reached if each not in ("SUMMARY", "DIV")],
                         ["files", "folder", "max-level", "blend", "setting", "bake"])
        self.value("document.querySelector('#sweep :checked').focus()")
        before = self.command()
        self.browser.key("ArrowUp", 38)
        self.assertNotEqual(self.command(), before)
        self.value("document.getElementById('bake').focus()")
        self.browser.key(" ", 32)
        self.browser.wait_for(f"{IDLE} && document.getElementById('result').checkVisibility()")
        self.assertEqual(self.value("document.activeElement.id"), "result-title")
        self.check_names({"link", "button", "combobox", "checkbox", "radio", "region", "Iframe"})

    def check_names(self, roles):
        """Everything of these roles is there, and has a name for screen readers."""
        nodes = [node for node in self.browser.call("Accessibility.getFullAXTree")["nodes"] if not node["ignored"]]
        found = {node["role"]["value"]: node.get("name", {}).get("value", "") for node in nodes}
        self.assertLessEqual(roles, found.keys())
        self.assertEqual([node for node in nodes if node["role"]["value"] in roles and not node.get("name", {}).get("value")], [])

    def test_narrow_light_and_dark(self):
        grounds = set()
        for scheme, width in (("light", 1100), ("light", 360), ("dark", 360), ("dark", 1100)):
            self.browser.prefer(scheme)
            self.browser.resize(width, 800, mobile=width < 500)
            self.browser.choose(self.tree)
            self.browser.click("bake")
            self.browser.wait_for("parseFloat(document.getElementById('inspect').style.height) > 1000")
            self.assertLessEqual(self.value("document.documentElement.scrollWidth"), width)
            grounds.add(self.value("getComputedStyle(document.documentElement).backgroundColor"))
            self.assertEqual(self.value(PALE), [])
        self.assertEqual(len(grounds), 2)

    def test_no_way_out(self):
        policy = self.value("document.querySelector('meta[http-equiv]').content")
        self.assertTrue(policy.startswith("default-src 'none';"))
        self.assertNotIn("connect-src", policy)
        self.assertEqual(self.value("fetch('https://example.invalid/').then(() => 'sent', () => 'blocked')"), "blocked")
        self.assertTrue(any("Content Security Policy" in line for line in self.browser.console), self.browser.console)
        self.browser.console.clear()
        self.browser.requests = [url for url in self.browser.requests if "example.invalid" not in url]

    def test_picture(self):
        if PICTURE is None:
            self.skipTest("--picture was not given")
        self.browser.resize(1100, 1250)
        self.browser.choose(self.tree)
        self.browser.screenshot(PICTURE)


class PackageTest(unittest.TestCase):
    """The npm package as a browser loads it from a server, without a bundler."""

    def test_modules_and_worker(self):
        with tempfile.TemporaryDirectory() as name, Page(pathlib.Path(name)) as page:
            folder = pathlib.Path(name)
            for name_of_file in ("index.js", "serve.js", "worker.js", "vellum.wasm"):
                shutil.copy(pathlib.Path(PAGE).resolve().parent / "package" / name_of_file, folder)
            (folder / "tree.glb").write_bytes(leaves())
            (folder / "page.html").write_text("<title>test</title><link rel=icon href=data:,>")
            handler = functools.partial(QuietHandler, directory=name)
            with http.server.ThreadingHTTPServer(("127.0.0.1", 0), handler) as server:
                threading.Thread(target=server.serve_forever, daemon=True).start()
                page.call("Page.navigate", url=f"http://127.0.0.1:{server.server_port}/page.html")
                page.wait_for("document.title === 'test'")
                found = page.evaluate("""(async () => {
                    const { load, VellumError } = await import("/index.js");
                    const { VellumWorker } = await import("/worker.js");
                    const glb = new Uint8Array(await (await fetch("/tree.glb")).arrayBuffer());
                    const text = (bytes) => [...new Uint8Array(bytes)].map((b) => b.toString(16).padStart(2, "0")).join("");
                    const digest = async (bytes) => text(await crypto.subtle.digest("SHA-256", bytes));
                    const vellum = await load();
                    const worker = new VellumWorker();
                    let steps = 0;
                    const made = await worker.bakeGltf(glb, { level: 4, onProgress: () => { ++steps; } });
                    const codeOf = (promise) => promise.then(() => "none", (error) => error instanceof VellumError && error.code);
                    const controller = new AbortController();
                    const cancelled = worker.sweepGltf(glb, { maxLevel: 12, signal: controller.signal });
                    controller.abort();
                    const codes = [await codeOf(cancelled), await codeOf(worker.readGltf(glb.subarray(0, 100)))];
                    const rows = (await worker.sweepGltf(glb)).rows.length;
                    worker.terminate();
                    const digests = [await digest(vellum.bakeGltf(glb, { level: 4 }).bytes), await digest(made.bytes)];
                    return [...digests, steps > 0, codes, rows];
                })()""")
                server.shutdown()
            expected = hashlib.sha256(vellum("bake", folder / "tree.glb", "-", "-q", "--level", "4")).hexdigest()
            rows = json.loads(vellum("sweep", folder / "tree.glb", "--json"))["rows"]
            self.assertEqual(found, [expected, expected, True, ["VELLUM_CANCELLED", "VELLUM_ERROR_FILE"], len(rows)])
            self.assertEqual(page.console, [])


def bake(source, target):
    with tempfile.TemporaryDirectory() as folder, Page(pathlib.Path(folder)) as page:
        page.open(PAGE)
        page.choose(source)
        page.evaluate("document.querySelector('#sweep label').click()")
        page.click("bake")
        if page.text("messages"):
            sys.exit(page.text("messages"))
        pathlib.Path(target).write_bytes(page.download("download").read_bytes())
    return 0


def main():
    global PAGE, VELLUM, PICTURE
    PAGE, VELLUM, *rest = sys.argv[1:]
    if "--picture" in rest:
        at = rest.index("--picture")
        PICTURE = rest[at + 1]
        del rest[at:at + 2]
    if not find_chromium():
        print("Chromium is not installed")
        return 77
    if VELLUM == "--bake":
        return bake(*rest)
    print(subprocess.run([find_chromium(), "--version"], capture_output=True, text=True, check=True).stdout.strip(), flush=True)
    return 0 if unittest.main(argv=[sys.argv[0], *rest], exit=False, verbosity=2).result.wasSuccessful() else 1


if __name__ == "__main__":
    sys.exit(main())
