#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""The Python package as its users install it, into virtual environments; its types; and the code of docs/python.md.

usage: python_package_test.py <folder of the libraries> <vellum> [unittest's arguments]
"""
import importlib.util
import os
import pathlib
import re
import shutil
import subprocess
import sys
import tempfile
import unittest
import zipfile

LIBRARIES, COMMAND = sys.argv[1:3]
ROOT = pathlib.Path(__file__).resolve().parents[2]
NEEDED = ["ensurepip", "pip", "setuptools"]


def run(*words, folder=None, status=0, **environment):
    """The output of a command, which is not to find anything but what is given to it."""
    hidden = ("LD_LIBRARY_PATH", "PYTHONPATH", "VELLUM_LIBRARY_PATH", "VIRTUAL_ENV")
    kept = {name: value for name, value in os.environ.items() if name not in hidden}
    done = subprocess.run([str(word) for word in words], env={**kept, **environment}, cwd=folder, text=True,
                          stdout=subprocess.PIPE, stderr=subprocess.STDOUT)
    if done.returncode != status:
        raise AssertionError(f"{' '.join(map(str, words))}: status {done.returncode}\n{done.stdout}")
    return done.stdout


class Package(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        folder = tempfile.TemporaryDirectory(prefix="vellum-package-")
        cls.addClassCleanup(folder.cleanup)
        cls.folder = pathlib.Path(folder.name)
        # pip builds in the folder of the sources, which stay as they are.
        cls.source = cls.folder / "source/bindings/python"
        shutil.copytree(ROOT / "bindings/python", cls.source, ignore=shutil.ignore_patterns("build", "*.egg-info", "__pycache__"))
        (cls.folder / "source/include/vellum").mkdir(parents=True)
        shutil.copy(ROOT / "include/vellum/vellum.h", cls.folder / "source/include/vellum")
        # `pip install .`, with Debian's setuptools: the libraries are found when the package is used.
        cls.plain = cls.environment("plain", "--system-site-packages")
        run(cls.plain, "-m", "pip", "install", "--no-build-isolation", "--no-index", ".", folder=cls.source)

    @classmethod
    def environment(cls, name, *options):
        run(sys.executable, "-m", "venv", *options, cls.folder / name)
        return cls.folder / name / "bin/python3"

    def check_example(self, python, **environment):
        output = run(python, ROOT / "examples/python/bake.py", folder=self.folder, **environment)
        self.assertRegex(output, r"^\d+ bytes of data for 1 of 2 triangles\n"
                         r"micro-triangles: 1\d{3} transparent, \d{3} opaque, \d{3} unknown\n"
                         "as it should be: level is 13, not 0 to 12 or VELLUM_LEVEL_AUTOMATIC\n$")
        return output

    def test_installed_without_libraries(self):
        found = run(self.plain, "-c", "import vellum; print(vellum.__file__)", folder=self.folder, VELLUM_LIBRARY_PATH=LIBRARIES)
        self.assertTrue(found.startswith(str(self.folder / "plain")), found)
        self.check_example(self.plain, VELLUM_LIBRARY_PATH=LIBRARIES)
        self.check_example(self.plain, LD_LIBRARY_PATH=LIBRARIES)  # as those that are installed

    def test_wheel_with_libraries(self):
        run(sys.executable, "-m", "pip", "wheel", "--no-build-isolation", "--no-index", "--wheel-dir", self.folder, self.source,
            VELLUM_LIBRARY_PATH=LIBRARIES)
        wheel, = self.folder.glob("*.whl")
        version = run(COMMAND, "--version").split()[1]
        self.assertRegex(wheel.name, rf"^vellum_omm-{re.escape(version)}-py3-none-linux_\w+\.whl$")
        with zipfile.ZipFile(wheel) as archive:
            names = {re.sub(r"-[\d.]+dist-info/(licenses/)?", "-", name) for name in archive.namelist()}
            metadata = archive.read(f"vellum_omm-{version}.dist-info/METADATA").decode()
        soname = version.rpartition(".")[0]
        self.assertLessEqual({"vellum/__init__.py", "vellum/py.typed", f"vellum/libvellum.so.{soname}",
                              f"vellum/libvellum_gltf.so.{soname}", "vellum_omm-LICENSE", "vellum_omm-THIRD-PARTY.md"}, names)
        self.assertIn("License: Apache-2.0", metadata)
        self.assertIn("Opacity micromaps in Python", metadata)
        # An environment with nothing in it.
        python = self.environment("whole")
        run(python, "-m", "pip", "install", "--no-index", wheel)
        self.check_example(python)
        tree, output = self.folder / "tree.glb", self.folder / "tree.omm.glb"
        run(python, ROOT / "examples/python/tree.py", tree)
        printed = run(python, ROOT / "examples/python/bake.py", tree, output, folder=self.folder)
        self.assertRegex(printed, r"\d+ bytes of micromaps for 1 primitives\n"
                         r'mesh 0 "tree" primitive 1: \d+ triangles, \d+ of them with a special index\n$')
        native = self.folder / "native.glb"
        run(COMMAND, "bake", "--quiet", "--max-level", "6", tree, native)
        self.assertEqual(output.read_bytes(), native.read_bytes())

    @unittest.skipIf(importlib.util.find_spec("numpy") is None, "numpy is not installed")
    def test_page(self):
        """The page's command, and its blocks of code, one after the other, as one program."""
        text = (ROOT / "docs/python.md").read_text(encoding="utf-8")
        install, = re.findall(r"^```sh\n(.*?)^```", text, re.M | re.S)
        python, root = self.environment("page", "--system-site-packages"), self.folder / "source"
        (root / "build/release").mkdir(parents=True)
        (root / "build/release/lib").symlink_to(LIBRARIES)
        pip = f"{python} -m pip install --no-build-isolation --no-index"
        run("sh", "-c", install.replace("pip install", pip), folder=root)
        self.assertIn("not the absolute path of a folder that has libvellum", run(
            "sh", "-c", install.replace("pip install", pip).replace("$PWD/", ""), folder=root, status=1))
        blocks = re.findall(r"^```python\n(.*?)^```", text, re.M | re.S)
        self.assertGreater(len(blocks), 3)
        run(sys.executable, ROOT / "examples/python/tree.py", self.folder / "tree.glb")
        program = self.folder / "page.py"
        program.write_text("import numpy\nimage = numpy.zeros((64, 64, 4), 'u1')\nimage[16:48, 16:48] = 255\n" + "\n".join(blocks))
        run(python, "-W", "error", program, folder=self.folder)

    @unittest.skipIf(importlib.util.find_spec("mypy") is None, "mypy is not installed")
    def test_types(self):
        def check(*files, status=0):
            return run(sys.executable, "-m", "mypy", "--strict", "--enable-incomplete-feature=Unpack",
                       "--cache-dir", self.folder / "mypy", "--python-executable", self.plain, *files,
                       folder=self.folder, status=status)

        program = self.folder / "program.py"
        text = ("import vellum\n\ncard = vellum.BakeInput(vellum.Texture(b'0000', 2, 2), bytes(24), uv_format=83)\n"
                "micromap = vellum.bake([card], level=3, progress=lambda done, total: print(done / total))\n"
                "size: int = len(micromap.data) + micromap.usages[0].count\n"
                "files, report = vellum.bake_gltf(b'', cache={}, blend=True)\n")
        program.write_text(text)
        check(self.source / "vellum", program)
        program.write_text(text + "vellum.bake(card, levle=3)\nvellum.bake(card, level='3')\nmicromap.date\nreport + 1\n")
        found = check(program, status=1)
        for line in range(7, 11):
            self.assertIn(f"program.py:{line}: error", found)


if __name__ == "__main__":
    if sys.version_info < (3, 11):
        print("skipped: the package needs Python 3.11")
        sys.exit(77)
    missing = [name for name in NEEDED if importlib.util.find_spec(name) is None]
    if missing:
        print(f"skipped: {sys.executable} has no {', '.join(missing)}: Debian's python3-venv, python3-pip, python3-setuptools")
        sys.exit(77)
    unittest.main(argv=sys.argv[:1] + sys.argv[3:])
