#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""Checks that the packaging states what the sources do: the version, the exported functions, and what the build needs.

usage: check_packaging.py [ROOT]
"""
import re

import findings

HEADER = "include/vellum/vellum.h"
# The other files that contain the version, and the soname's part of it.
VERSIONS = (("debian/changelog", r"\Avellum \(([\d.]+)-"),
            ("packaging/arch/PKGBUILD", r"(?m)^pkgver=(.*)$"),
            ("packaging/flatpak/org.freedesktop.Platform.VulkanLayer.Vellum.metainfo.xml", r'<release version="([^"]*)"'),
            ("packaging/vcpkg/vellum/vcpkg.json", r'"version": "([^"]*)"'))
SONAMES = (("debian/control", r"(?m)^Package: libvellum([\d.]+)$"),
           ("debian/libvellum0.1.symbols", r"(?m)^libvellum\.so\.(\S+) "),
           ("debian/libvellum0.1.symbols", r"(?m)^libvellum_gltf\.so\.(\S+) "))
SYMBOLS = "debian/libvellum0.1.symbols"
EXPORTS = ("src/library/exports.map", "src/gltflibrary/exports.map")
SETUP = "scripts/setup"
CONTROL = "debian/control"
PAGE = "docs/install.md"
# debhelper and its parts come with packaging, g++ with every Debian build.
OF_PACKAGING = {"debhelper-compat", "dh-sequence-python3"}
OF_EVERY_BUILD = {"g++"}
FILES = (HEADER, SYMBOLS, SETUP, CONTROL, PAGE, *EXPORTS, *(name for name, _ in VERSIONS))


def find(root, name, pattern):
    found = re.search(pattern, (root / name).read_text(encoding="utf-8"))
    return found[1] if found else None


def exported(text):
    """The functions of an exports.map, each with its version, and the version as dpkg-gensymbols lists it."""
    version = re.search(r"^(\w+\.\d+|\w+_\d+\.\d+) \{", text, re.M)[1]
    return {f"{name}@{version}" for name in [version, *re.findall(r"^ {4}(\w+);", text, re.M)]}


def check_symbols(root):
    listed = set(re.findall(r"(?m)^ (\S+) \S+$", (root / SYMBOLS).read_text(encoding="utf-8")))
    exports = set().union(*(exported((root / name).read_text(encoding="utf-8")) for name in EXPORTS))
    return [f"{SYMBOLS}: {symbol} is {'not exported' if symbol in listed else 'missing'}" for symbol in sorted(listed ^ exports)]


def build_packages(root):
    """The Debian packages that scripts/setup installs for a build."""
    lists = [find(root, SETUP, rf"(?ms)^{name}=\((.*?)\)$") for name in ("tools", "libraries")]
    return OF_EVERY_BUILD.union(*(re.sub(r"#.*", "", text).split() for text in lists))


def check_build_packages(root):
    control = find(root, CONTROL, r"(?s)Build-Depends:\n(.*?)\n[A-Z]")
    page = find(root, PAGE, r"(?s)```sh-packages\napt-get install -y --no-install-recommends (.*?)```")
    lists = {CONTROL: set(re.findall(r"(?m)^ ([\w+.-]+)", control)) - OF_PACKAGING | OF_EVERY_BUILD,
             PAGE: set(page.replace("\\\n", " ").split())}
    expected = build_packages(root)
    return [f"{name}: {package} is {'not in' if package in packages else 'only in'} {SETUP}"
            for name, packages in lists.items() for package in sorted(packages ^ expected)]


def check(root):
    version = ".".join(re.search(r"VELLUM_HEADER_VERSION VELLUM_MAKE_VERSION\((\d+), (\d+), (\d+)\)",
                                 (root / HEADER).read_text(encoding="utf-8")).groups())
    soname = version.rpartition(".")[0]
    expected = [(name, pattern, version) for name, pattern in VERSIONS] + [(name, pattern, soname) for name, pattern in SONAMES]
    found = [f"{name}: the version is {find(root, name, pattern)}, in {HEADER} {number}"
             for name, pattern, number in expected if find(root, name, pattern) != number]
    return found + check_symbols(root) + check_build_packages(root), len(expected)


if __name__ == "__main__":
    findings.run(check, "versions")
