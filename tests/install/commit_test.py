#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""Checks which commit `vellum --version` prints: that of a checkout, that of a source archive, none for a mere copy.

usage: commit_test.py --source CHECKOUT --cmake PROGRAM
"""
import argparse
import pathlib
import shutil
import subprocess
import sys
import tempfile
import unittest

options = argparse.Namespace()
FILES = [".gitattributes", "cmake/commit.cmake", "cmake/commit.txt", "include/vellum/vellum.h", "scripts/archive", "scripts/phase"]


def run(*command, folder=None):
    return subprocess.run([str(word) for word in command], cwd=folder, check=True, stdout=subprocess.PIPE, text=True).stdout


class Commit(unittest.TestCase):
    def setUp(self):
        self.folder = tempfile.TemporaryDirectory()
        self.addCleanup(self.folder.cleanup)
        self.path = pathlib.Path(self.folder.name)
        self.checkout = self.path / "checkout"
        for name in FILES:
            (self.checkout / name).parent.mkdir(parents=True, exist_ok=True)
            shutil.copy(options.source / name, self.checkout / name)

    def commit(self, message):
        identity = ["-c", "user.name=test", "-c", "user.email=test@localhost", "-c", "commit.gpgsign=false"]
        run("git", *identity, "commit", "--quiet", "--allow-empty", "--message", message, folder=self.checkout)
        return run("git", "rev-parse", "HEAD", folder=self.checkout)[:12]

    def header(self, source):
        header = self.path / "commit.h"
        run(options.cmake, f"-DSOURCE={source}", f"-DHEADER={header}", f"-DGIT={shutil.which('git')}",
            "-P", source / "cmake/commit.cmake")
        return header.read_text()

    def test_copy(self):
        self.assertIn('kCommit = "";', self.header(self.checkout))

    def test_checkout_and_archive(self):
        run("git", "init", "--quiet", folder=self.checkout)
        run("git", "add", ".", folder=self.checkout)
        first = self.commit("first")
        self.assertIn(f'kCommit = "{first}";', self.header(self.checkout))
        second = self.commit("second")
        self.assertIn(f'kCommit = "{second}";', self.header(self.checkout))
        archive = run("scripts/archive", self.path / "new/folder", folder=self.checkout).strip()
        run("tar", "-xf", archive, "-C", pathlib.Path(archive).parent)
        self.assertIn(f'kCommit = "{second}";', self.header(pathlib.Path(archive.removesuffix(".tar.gz"))))

    def test_header_is_written_only_if_it_differs(self):
        self.header(self.checkout)
        before = (self.path / "commit.h").stat().st_mtime_ns
        self.header(self.checkout)
        self.assertEqual((self.path / "commit.h").stat().st_mtime_ns, before)


def main():
    parser = argparse.ArgumentParser()
    parser.add_argument("--source", type=pathlib.Path, required=True)
    parser.add_argument("--cmake", required=True)
    rest = parser.parse_known_args(namespace=options)[1]
    unittest.main(argv=[sys.argv[0], *rest])


if __name__ == "__main__":
    main()
