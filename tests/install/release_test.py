#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""Makes the parts of a release that need no compiler, of a small checkout, and checks what describes them.

usage: release_test.py --source CHECKOUT
"""
import argparse
import hashlib
import importlib.machinery
import importlib.util
import io
import json
import pathlib
import re
import shutil
import subprocess
import sys
import tarfile
import tempfile
import unittest
import zipfile

options = argparse.Namespace()
FILES = [".gitattributes", ".gitignore", "CHANGELOG.md", "cmake/commit.txt", "include/vellum/vellum.h", "scripts/archive",
         "scripts/phase", "scripts/release"]
IDENTITY = ["-c", "user.name=test", "-c", "user.email=test@localhost", "-c", "commit.gpgsign=false", "-c", "tag.gpgsign=false"]


def module():
    """scripts/release, as a module."""
    loader = importlib.machinery.SourceFileLoader("release", str(options.source / "scripts/release"))
    sys.dont_write_bytecode = True  # a new file would be a change of the checkout
    found = importlib.util.module_from_spec(importlib.util.spec_from_loader("release", loader))
    loader.exec_module(found)
    return found


class ReleaseTest(unittest.TestCase):
    def setUp(self):
        folder = tempfile.TemporaryDirectory()
        self.addCleanup(folder.cleanup)
        self.path = pathlib.Path(folder.name)
        self.checkout = self.path / "checkout"
        for name in FILES:
            (self.checkout / name).parent.mkdir(parents=True, exist_ok=True)
            shutil.copy(options.source / name, self.checkout / name)
        self.git("init", "--quiet")
        self.commit()
        header = (self.checkout / "include/vellum/vellum.h").read_text()
        self.version = ".".join(re.search(r"VELLUM_MAKE_VERSION\((\d+), (\d+), (\d+)\)$", header, re.M).groups())

    def git(self, *words):
        subprocess.run(["git", *IDENTITY, *words], cwd=self.checkout, check=True)

    def commit(self):
        self.git("add", ".")
        self.git("commit", "--quiet", "--message", "a commit")

    def release(self, folder, *words, status=0):
        done = subprocess.run([sys.executable, self.checkout / "scripts/release", self.path / folder, *words], check=False,
                              capture_output=True, text=True)
        self.assertEqual(done.returncode, status, done.stdout + done.stderr)
        return done.stdout + done.stderr

    def files(self, folder):
        return {path.name: path.read_bytes() for path in sorted((self.path / folder).iterdir()) if path.name != ".release.json"}

    def test_everything_is_described(self):
        self.release("out", "source")
        files = self.files("out")
        archive, bill = f"vellum-{self.version}.tar.gz", f"vellum-{self.version}.spdx.json"
        self.assertEqual(set(files), {archive, bill, "RELEASE-NOTES.md", "SHA256SUMS"})
        sums = dict(reversed(line.split("  ")) for line in files["SHA256SUMS"].decode().splitlines())
        self.assertEqual(sums, {name: hashlib.sha256(data).hexdigest() for name, data in files.items() if name != "SHA256SUMS"})
        with tarfile.open(fileobj=io.BytesIO(files[archive])) as file:
            self.assertEqual({name for name in file.getnames() if not file.getmember(name).isdir()},
                             {f"vellum-{self.version}/{name}" for name in FILES})
        notes = files["RELEASE-NOTES.md"].decode()
        self.assertIn(f"| `{archive}` | source archive | {len(files[archive]):,} |", notes)
        section = (options.source / "CHANGELOG.md").read_text(encoding="utf-8").split("\n## ")[1]
        self.assertIn(section.split("### ")[1].splitlines()[0], notes)
        self.assertNotRegex(notes, r"\]\((?!https?:)")
        self.check_bill(json.loads(files[bill]), {archive: sums[archive]})

    def check_bill(self, bill, archives):
        self.assertEqual((bill["spdxVersion"], bill["dataLicense"], bill["SPDXID"]), ("SPDX-2.3", "CC0-1.0", "SPDXRef-DOCUMENT"))
        self.assertRegex(bill["documentNamespace"], r"^urn:uuid:[0-9a-f-]{36}$")
        self.assertRegex(bill["creationInfo"]["created"], r"^\d{4}-\d\d-\d\dT\d\d:\d\d:\d\dZ$")
        packages = {package["SPDXID"]: package for package in bill["packages"]}
        self.assertEqual(len(packages), len(bill["packages"]))
        for identity, package in packages.items():
            self.assertRegex(identity, r"^SPDXRef-[A-Za-z0-9.-]+$")
            for member in ("name", "downloadLocation", "licenseConcluded", "licenseDeclared", "copyrightText"):
                self.assertTrue(package[member], identity)
        for relation in bill["relationships"]:
            for member in ("spdxElementId", "relatedSpdxElement"):
                self.assertIn(relation[member], {"SPDXRef-DOCUMENT", *packages})
        described = [packages[relation["relatedSpdxElement"]] for relation in bill["relationships"]
                     if relation["relationshipType"] == "DESCRIBES"]
        self.assertEqual({package["packageFileName"]: package["checksums"][0]["checksumValue"] for package in described}, archives)

    def test_again(self):
        first = self.release("out", "source")
        self.assertNotIn("done before", first)
        files = self.files("out")
        self.assertIn("source: done before", self.release("out", "source"))
        self.assertEqual(self.files("out"), files)
        self.release("other", "source")
        self.assertEqual(self.files("other"), files)

    def test_another_commit(self):
        self.release("out", "source")
        before = self.files("out")
        (self.checkout / "new").write_text("content")
        self.assertIn("?? new", self.release("out", "source", status=1))
        self.assertEqual(self.files("out"), before)
        self.commit()
        self.assertNotIn("done before", self.release("out", "source"))
        self.assertNotEqual(self.files("out"), before)

    def test_tag(self):
        changelog = self.checkout / "CHANGELOG.md"
        text = changelog.read_text(encoding="utf-8")
        for date, status in (("unreleased", 1), ("2026-12-01", 0)):
            changelog.write_text(re.sub(rf"(?m)^## {self.version} \(.*\)$", f"## {self.version} ({date})", text), encoding="utf-8")
            self.git("add", ".")
            self.git("commit", "--quiet", "--allow-empty", "--message", date)
            self.git("tag", "--force", f"v{self.version}", "--annotate", "--message", "release")
            output = self.release("out", "source", status=status)
            self.assertEqual("is tagged, but its date is 'unreleased'" in output, status == 1)

    def test_wrong_part(self):
        self.assertIn("invalid choice: 'sources'", self.release("out", "sources", status=2))

    def test_failing_part(self):
        (self.checkout / "scripts/archive").write_text("#!/bin/sh\necho it broke; exit 3\n")
        self.commit()
        output = self.release("out", "source", status=1)
        self.assertIn("it broke", output)
        self.assertEqual(self.files("out"), {})

    def test_interfaces(self):
        head = "Functions changes summary: 0 Removed, 1 Changed (10 filtered out), 0 Added functions\n"
        changed = """
  [C] 'function VellumResult vellumGetGeometryInfo(VellumGeometryInfo*)' has some indirect sub-type changes:
    parameter 3 of type 'VellumGeometryInfo*' has sub-type changes:
      in pointed to type 'typedef VellumGeometryInfo':
        underlying type 'struct VellumGeometryInfo' changed:
          type size changed from 320 to 384 (in bits)
          1 data member insertion:
            'size_t extra', at offset 320 (in bits)
"""
        addition = """
1 Added function:
  [A] 'function VellumResult vellumWriteIndices(const int32_t*, size_t, uint32_t, void*)'    {vellumWriteIndices@@VELLUM_0.1}
"""
        moved = "            'const int32_t* indices' offset changed from 64 to 128 (in bits) (by +64 bits)\n"
        removal = "  [D] 'function uint32_t vellumGetVersion()'    {vellumGetVersion@@VELLUM_0.1}\n"
        release = module()
        for report, lines in ((head + changed + addition, []), (head + changed + moved, [moved]), (head + removal, [removal]),
                              ("Functions changes summary: 1 Removed, 0 Changed, 0 Added function\n", None)):
            broken = [line + "\n" for line in report.splitlines() if not release.ADDITION.match(line)]
            self.assertEqual(broken, [report] if lines is None else lines)

    def test_what_is_linked(self):
        release = module()
        listed = b"libdraco-dev 1.5.5+dfsg-2 draco\ngcc-12-base 12.2.0-14 gcc-12\n"
        path = self.path / "vellum.zip"
        with zipfile.ZipFile(path, "w") as file:
            file.writestr("vellum/licenses/versions.txt", listed)
        found = release.linked(path)
        self.assertEqual(found, [("libdraco-dev", "1.5.5+dfsg-2", "draco"), ("gcc-12-base", "12.2.0-14", "gcc-12")])
        self.assertEqual([release.licence_of(source) for _, _, source in found],
                         ["Apache-2.0", "GPL-3.0-or-later WITH GCC-exception-3.1"])
        with self.assertRaisesRegex(release.Failed, "licence of nonesuch"):
            release.licence_of("nonesuch")


if __name__ == "__main__":
    parser = argparse.ArgumentParser()
    parser.add_argument("--source", type=pathlib.Path, required=True)
    options, rest = parser.parse_known_args()
    unittest.main(argv=[sys.argv[0], *rest])
