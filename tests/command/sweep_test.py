#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""`vellum sweep`, `vellum bake --target-known` and `vellum inspect A B`: what they report is what separate bakes make.

usage: sweep_test.py VELLUM
"""
import html
import json
import pathlib
import shlex
import subprocess
import sys
import tempfile
import unittest
import xml.etree.ElementTree

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parent.parent / "inspect"))
import made_up  # noqa: E402

VELLUM = sys.argv.pop(1)
MASK, BLEND = b'"alphaMode": "MASK"', b'"alphaMode":"BLEND"'  # of the same length


def run(*arguments, code=0):
    done = subprocess.run([VELLUM, *map(str, arguments)], capture_output=True, text=True, timeout=300)
    assert done.returncode == code, (arguments, done.returncode, done.stdout, done.stderr)
    return done


def report(*arguments, code=0):
    return json.loads(run(*arguments, "--json", code=code).stdout)


def bytes_of(file):
    return sum(micromap["bytes"] for micromap in file["micromaps"])


class Sweep(unittest.TestCase):
    def setUp(self):
        temporary = tempfile.TemporaryDirectory()
        self.addCleanup(temporary.cleanup)
        self.folder = pathlib.Path(temporary.name)

    def write(self, name, meshes):
        (self.folder / name).parent.mkdir(exist_ok=True)
        (self.folder / name).write_bytes(made_up.glb(meshes))
        return self.folder / name

    def tree(self, name="tree.glb"):
        return self.write(name, [("leaves", "leaf", made_up.disc(64), 3), ("twigs", "twig", made_up.holes(32), 2)])

    def bake(self, path, *options):
        return report("bake", path, "--dry-run", *options)["files"][0]

    def test_rows_are_bakes(self):
        tree = self.tree()
        for more in ((), ("--min-known", "0.3", "--max-level", "5"), ("--exact", "--two-state-rule", "opaque", "--max-level", "4")):
            rows = report("sweep", tree, *more)["rows"]
            self.assertEqual(len({row["options"] for row in rows}), len(rows))
            kinds = {(row["states"], row["level"] is None, row["budget"] is None) for row in rows}
            self.assertEqual(kinds, {(4, True, True), (4, False, True), (2, True, True), (2, False, True), (4, True, False)})
            for row in rows:
                baked = self.bake(tree, *row["options"].split(), *more)
                self.assertEqual(row["bytes"], bytes_of(baked), row)
                self.assertAlmostEqual(row["known"], baked["surface"]["known"], 9, row)
                self.assertAlmostEqual(row["shaderCalls"], 1000 * (1 - row["known"]))
                levels = {}
                for primitive in baked["primitives"]:
                    for level, count in primitive["levels"].items():
                        levels[level] = levels.get(level, 0) + count
                self.assertEqual(row["levels"], levels, row)
            # What 2 states know with proof is what 4 states know without --min-known.
            if not more:
                four = {row["level"]: row["known"] for row in rows if row["states"] == 4 and row["budget"] is None}
                for row in rows:
                    if row["states"] == 2:
                        self.assertAlmostEqual(row["proven"], four[row["level"]], 9)
                        self.assertEqual(row["known"], 1)
            # Larger budgets than those shown change nothing.
            last = [row for row in rows if row["budget"]][-1]
            self.assertEqual(bytes_of(self.bake(tree, "--budget", 16 * last["budget"], *more)), last["bytes"])

    def test_rows_of_folders_are_sums_and_means(self):
        self.tree("in/a.glb")
        self.write("in/b.glb", [("hedge", "hedge", made_up.holes(64), 1)])
        swept = report("sweep", self.folder / "in")
        self.assertEqual(len(swept["files"]), 2)
        for row in swept["rows"]:
            baked = [self.bake(self.folder / "in" / name, *row["options"].split()) for name in ("a.glb", "b.glb")]
            self.assertEqual(row["bytes"], sum(map(bytes_of, baked)), row)
            self.assertAlmostEqual(row["known"], sum(file["surface"]["known"] for file in baked) / 2, 9)
        # A file that cannot be read does not end it.
        (self.folder / "in" / "c.glb").write_bytes(b"glTF")
        damaged = report("sweep", self.folder / "in", code=1)
        self.assertEqual(damaged["rows"], swept["rows"])
        self.assertIn("c.glb", damaged["files"][2]["error"])

    def test_recommendation(self):
        swept = report("sweep", self.tree())
        exact = [row for row in swept["rows"] if row["states"] == 4]
        enough = 0.95 * max(row["known"] for row in exact)
        chosen = next(row for row in exact if row["options"] == swept["recommendation"]["options"])
        self.assertGreaterEqual(chosen["known"], enough)
        self.assertEqual(chosen["bytes"], min(row["bytes"] for row in exact if row["known"] >= enough))
        series = [row for row in exact if row["level"]]
        for before, row in zip(series, series[1:]):
            if row["known"] > before["known"]:
                self.assertAlmostEqual(row["bytesPerPercent"] * 100 * (row["known"] - before["known"]),
                                       row["bytes"] - before["bytes"], 6)

    def test_recommends_what_was_measured(self):
        tree = self.tree()
        tree.write_bytes(tree.read_bytes().replace(MASK, BLEND, 1))
        given = ["--blend", "--exclude-mesh", "a 'b' *", "--max-level", "4", "--min-known", "0.1"]
        swept = report("sweep", tree, *given)
        options = shlex.split(swept["recommendation"]["options"])
        self.assertEqual(sorted(options[2:]), sorted(given))
        chosen = next(row for row in swept["rows"] if row["options"] == " ".join(options[:2]))
        baked = self.bake(tree, *options)
        self.assertEqual(chosen["bytes"], bytes_of(baked))
        self.assertAlmostEqual(chosen["known"], baked["surface"]["known"], 9)
        for text in (run("sweep", tree, *given).stdout, html.unescape(run("sweep", tree, *given, "-o", "-").stdout)):
            self.assertIn(swept["recommendation"]["options"], text)

    def test_patterns_of_files_that_are_not_read(self):
        tree, damaged = self.tree(), self.folder / "damaged.glb"
        self.assertIn("glass* matches no material", run("sweep", tree, "--exclude-material", "glass*").stderr)
        damaged.write_bytes(b"glTF")
        self.assertNotIn("matches no", run("sweep", tree, damaged, "--exclude-material", "glass*", code=1).stderr)

    def test_states_what_is_not_in_it(self):
        tree = self.tree()
        tree.write_bytes(tree.read_bytes().replace(MASK, BLEND, 1))
        swept = report("sweep", tree)
        baked = self.bake(tree)
        self.assertAlmostEqual(swept["files"][0]["withoutMicromap"], baked["surface"]["withoutMicromap"], 9)
        self.assertGreater(baked["surface"]["withoutMicromap"], 0.1)
        for command, words in (("sweep", "of the alpha-tested surface gets no micromap"), ("bake", "of it has no micromap")):
            text = run(command, tree).stdout
            self.assertIn(words, text)
            self.assertIn("--blend bakes it", text)
        tree.write_bytes(tree.read_bytes().replace(MASK, BLEND))
        self.assertIn("no primitive gets a micromap: ", run("sweep", tree, code=1).stderr)

    def test_outputs(self):
        tree = self.tree()
        chart, page = self.folder / "chart.svg", self.folder / "page.html"
        run("sweep", tree, "-o", chart)
        xml.etree.ElementTree.parse(chart)
        run("sweep", tree, "-o", page)
        text = page.read_text(encoding="utf-8")
        for row in report("sweep", tree)["rows"]:
            self.assertIn(f"<td>{row['options']}<td>{row['bytes']:,}<td>", text)
        self.assertIn("<svg ", text)
        self.assertEqual(run("sweep", tree, "-o", "-").stdout, text)
        run("sweep", tree, "-o", page)  # it is vellum's own
        page.write_text("notes")
        run("sweep", tree, "-o", page, code=1)
        run("sweep", tree, "-o", page, "--force")
        self.assertEqual(sorted(path.name for path in self.folder.iterdir()), ["chart.svg", "page.html", "tree.glb"])
        # Names are text.
        evil = self.tree("<script>&.glb")
        run("sweep", evil, "-o", page)
        self.assertNotIn("<script>&", page.read_text(encoding="utf-8"))

    def test_rejects(self):
        tree = self.tree()
        (self.folder / "empty").mkdir()
        self.assertIn("no .glb or .gltf", run("sweep", self.folder / "empty", code=1).stderr)
        run("sweep", self.folder / "none.glb", code=1)
        for arguments in ((), (tree, "--level", "3"), (tree, "--budget", "1K"), (tree, "--states", "2"), (tree, "-o", "a.glb"),
                          (tree, "-o", "-", "--json"), (tree, "--max-level", "13"), (tree, "--target-known", "0.5")):
            done = run("sweep", *arguments, code=2)
            self.assertEqual((done.stdout, len(done.stderr.splitlines())), ("", 1), arguments)

    def test_target_known(self):
        tree = self.tree()
        best = self.bake(tree, "--budget", "1G")["surface"]["known"]
        for share in (0, 0.3, 0.5, 0.7, 0.8, best):
            baked = self.bake(tree, "--target-known", share)
            self.assertGreaterEqual(baked["surface"]["known"], share - 1e-9)
            # No budget reaches it with clearly fewer bytes.
            low, high = 0, bytes_of(self.bake(tree, "--budget", "1G"))
            while low < high:
                budget = (low + high) // 2
                if self.bake(tree, "--budget", budget)["surface"]["known"] < share - 1e-12:
                    low = budget + 1
                else:
                    high = budget
            self.assertLessEqual(bytes_of(baked), max(1.02 * high, high + 18), share)
        out = self.folder / "out.glb"
        error = run("bake", tree, out, "--target-known", "0.9999", code=1).stderr
        most = float(error.split("at most ")[1].split()[0])
        self.assertAlmostEqual(most, best, delta=1e-4)
        self.assertFalse(out.exists())
        self.assertGreaterEqual(self.bake(tree, "--target-known", most)["surface"]["known"], most - 1e-9)
        # Fixed levels are the highest.
        third = self.bake(tree, "--level", "3")["surface"]["known"]
        self.assertGreaterEqual(self.bake(tree, "--level", "3", "--target-known", third - 1e-6)["surface"]["known"], third - 1e-6)
        run("bake", tree, out, "--level", "3", "--target-known", third + 0.01, code=1)
        for wrong in (("1.1",), ("-0.1",), ("nan",), ("80%",), ("0.5", "--budget", "1K"), ("0.5", "--states", "2")):
            run("bake", tree, "--dry-run", "--target-known", *wrong, code=2)
        # What is skipped counts as unknown.
        tree.write_bytes(tree.read_bytes().replace(MASK, BLEND, 1))
        self.assertIn("of it gets no micromap", run("bake", tree, out, "--target-known", "0.9", code=1).stderr)

    def test_rounded_coordinates_do_not_raise_levels(self):
        expected = None
        for scale in (1, 0.999, 0.9998, 1.0002, 1.001):
            grid = made_up.grid
            made_up.grid = lambda columns: (grid(columns)[0], [scale * uv for uv in grid(columns)[1]])
            path = self.write("scaled.glb", [("leaves", "leaf", made_up.disc(64), 1), ("twigs", "twig", made_up.holes(32), 4)])
            made_up.grid = grid
            baked = self.bake(path)
            levels = [primitive["levels"] for primitive in baked["primitives"]]
            expected = expected or levels
            self.assertEqual(levels, expected, scale)


class Comparison(unittest.TestCase):
    def test_two_bakes(self):
        with tempfile.TemporaryDirectory() as name:
            folder = pathlib.Path(name)
            tree = folder / "tree.glb"
            tree.write_bytes(made_up.glb([("leaves", "leaf", made_up.disc(64), 3), ("twigs", "twig", made_up.holes(32), 2)]))
            a, b, page = folder / "a.glb", folder / "b.glb", folder / "page.html"
            reports = [report("bake", tree, a, "--level", "2")["files"][0],
                       report("bake", tree, b, "--level", "4", "--exclude-material", "twig")["files"][0]]
            compared = report("inspect", a, b, "-o", page)
            self.assertEqual([file["file"] for file in compared["files"]], [str(a), str(b)])
            for side, baked in zip(("first", "second"), reports):
                whole = compared["comparison"]["all"][side]
                self.assertEqual(whole["bytes"], bytes_of(baked))
                self.assertAlmostEqual(whole["known"], baked["surface"]["known"], 9)
            materials = {part["name"]: part for part in compared["comparison"]["materials"]}
            self.assertEqual(set(materials), {"leaf", "twig"})
            self.assertEqual(list(materials["leaf"]["second"]["levels"]), ["4"])
            # Skipped in the second file: still part of its surface.
            self.assertEqual(materials["twig"]["second"], {"known": 0, "bytes": 0, "triangles": 0, "levels": {}})
            self.assertGreater(materials["twig"]["first"]["known"], 0)
            self.assertEqual(materials["leaf"]["first"]["bytes"] + materials["twig"]["first"]["bytes"], bytes_of(reports[0]))
            self.assertEqual({part["name"] for part in compared["comparison"]["meshes"]}, {"leaves", "twigs"})
            text = run("inspect", a, b).stdout
            self.assertIn("by material", text)
            self.assertIn(f"{bytes_of(reports[1]):,}", text)
            self.assertIn("leaf", page.read_text(encoding="utf-8"))
            self.assertEqual({path.name for path in folder.iterdir()}, {"tree.glb", "a.glb", "b.glb", "page.html"})
            for more in (("--picture", "a.svg"), ("--mesh", "0"), ("--material", "leaf"), ("--triangle", "1"),
                         ("-o", "x.svg"), ("-o", "x.html", "--html", "y.html")):
                run("inspect", a, b, *more, code=2)
            self.assertIn("tree.glb: no primitive has a micromap", run("inspect", a, tree, code=1).stderr)
            run("inspect", tree, tree, "--bake", "--level", "1")


if __name__ == "__main__":
    unittest.main()
