#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""Tests check_packaging.py on copies of the project's files."""
import pathlib
import shutil
import sys
import tempfile
import unittest

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parent))
import check_packaging  # noqa: E402

ROOT = pathlib.Path(__file__).resolve().parents[2]


def findings_with(file, old, new):
    with tempfile.TemporaryDirectory() as folder:
        root = pathlib.Path(folder)
        for name in check_packaging.FILES:
            (root / name).parent.mkdir(parents=True, exist_ok=True)
            shutil.copy(ROOT / name, root / name)
        text = (root / file).read_text(encoding="utf-8")
        if old not in text:
            raise AssertionError(f"{old!r} is not in {file}")
        (root / file).write_text(text.replace(old, new), encoding="utf-8")
        return check_packaging.check(root)[0]


class CheckPackaging(unittest.TestCase):
    def test_same(self):
        self.assertEqual(findings_with("debian/changelog", "vellum", "vellum"), [])

    def test_versions(self):
        version = check_packaging.find(ROOT, "packaging/arch/PKGBUILD", r"pkgver=(.*)")
        for name, _ in check_packaging.VERSIONS:
            found, = findings_with(name, version, "7.8.9")
            self.assertIn(f"{name}: the version is 7.8.9", found)

    def test_soname(self):
        found, = findings_with("debian/control", "Package: libvellum0.1", "Package: libvellum9")
        self.assertIn("debian/control: the version is 9", found)

    def test_symbols(self):
        self.assertEqual(findings_with(check_packaging.SYMBOLS, " vellumBake@", " vellumBaker@"), [
            f"{check_packaging.SYMBOLS}: vellumBake@VELLUM_0.1 is missing",
            f"{check_packaging.SYMBOLS}: vellumBaker@VELLUM_0.1 is not exported"])

    def test_build_packages(self):
        self.assertEqual(findings_with(check_packaging.CONTROL, " libpng-dev,\n", ""),
                         ["debian/control: libpng-dev is only in scripts/setup"])
        self.assertEqual(findings_with(check_packaging.PAGE, "libpng-dev libjpeg-dev", "libjpeg-dev libtiff-dev"), [
            "docs/install.md: libpng-dev is only in scripts/setup", "docs/install.md: libtiff-dev is not in scripts/setup"])


if __name__ == "__main__":
    unittest.main()
