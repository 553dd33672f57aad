# SPDX-License-Identifier: Apache-2.0
"""Builds the package with the version of the C header. The libraries of the folder $VELLUM_LIBRARY_PATH become part of it,
and a wheel is for this platform. Without, a wheel is for every platform, and uses the libraries of the system."""
import os
import pathlib
import re
import shutil
import sys

from setuptools import Distribution, setup
from setuptools.command.build_py import build_py

HERE = pathlib.Path(__file__).resolve().parent
LIBRARIES = os.environ.get("VELLUM_LIBRARY_PATH")


def version():
    text = (HERE.parents[1] / "include/vellum/vellum.h").read_text(encoding="utf-8")
    return ".".join(re.search(r"VELLUM_HEADER_VERSION VELLUM_MAKE_VERSION\((\d+), (\d+), (\d+)\)", text).groups())


def files():
    """What the package loads from its folder (vellum/_native.py)."""
    names = ("vellum", "vellum_gltf")
    if sys.platform == "win32":
        return [f"{name}.dll" for name in names]
    return [f"lib{name}.so.{version().rpartition('.')[0]}" for name in names]


class Build(build_py):
    def run(self):
        super().run()
        if LIBRARIES:
            base, gltf = (pathlib.Path(LIBRARIES, name) for name in files())
            if not base.is_absolute() or not base.exists():
                raise SystemExit(f"VELLUM_LIBRARY_PATH is not the absolute path of a folder that has {base.name}: {LIBRARIES}")
            shutil.copy(base, pathlib.Path(self.build_lib, "vellum"))
            if gltf.exists():  # not so in a build of libvellum alone
                shutil.copy(gltf, pathlib.Path(self.build_lib, "vellum"))


class Packaged(Distribution):
    def has_ext_modules(self):
        return bool(LIBRARIES)


commands = {"build_py": Build}
try:
    try:
        from setuptools.command.bdist_wheel import bdist_wheel
    except ImportError:  # before setuptools 70
        from wheel.bdist_wheel import bdist_wheel

    class Wheel(bdist_wheel):
        """The libraries do not depend on Python's version."""

        def get_tag(self):
            return ("py3", "none", super().get_tag()[2])

    commands["bdist_wheel"] = Wheel
except ImportError:  # no wheel is made
    pass

setup(
    name="vellum-omm", version=version(), description="Exact baker of opacity micromaps from alpha textures, and of glTF files",
    long_description=(HERE / "README.md").read_text(encoding="utf-8"), long_description_content_type="text/markdown",
    license="Apache-2.0", license_files=["LICENSE", "THIRD-PARTY.md"], python_requires=">=3.11", packages=["vellum"],
    package_data={"vellum": ["py.typed"]}, zip_safe=False, cmdclass=commands, distclass=Packaged)
