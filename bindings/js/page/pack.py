#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""Packs the page for browsers into one file: text, style, code and the module in WebAssembly.

usage: pack.py MODULE.wasm VERSION OUT.html
"""
import base64
import pathlib
import re
import sys

HERE = pathlib.Path(__file__).resolve().parent
INSPECT = HERE.parents[2] / "src/inspect/page"


def text_of(*paths):
    return "".join(path.read_text(encoding="utf-8") for path in paths)


def base64_of(path):
    return base64.b64encode(pathlib.Path(path).read_bytes()).decode()


def main():
    module, version, out = sys.argv[1:]
    # The page and its worker run the same code. It is a classic script, because browsers run no module from a Blob in a worker if
    # the page is a local file.
    code = text_of(INSPECT / "elements.js", *(HERE.parent / name for name in ("index.js", "serve.js", "worker.js")), HERE / "page.js")
    code = re.sub(r"^import .* from './index.js';$", "", code, flags=re.M)
    code = re.sub(r"^export (?=class |const |function |async )", "", code, flags=re.M).replace("import.meta.url", "location.href")
    if re.search(r"^\s*(import|export)\s|</script|<!--", code, re.M):
        sys.exit("pack.py: the code cannot stand in one classic script")
    parts = {
        "<!--@version-->": version,
        "<!--@style-->": f"<style>\n{text_of(INSPECT / 'style.css', HERE / 'style.css')}</style>",
        "<!--@module-->": f'<script type="text/plain" id="module">{base64_of(module)}</script>',
        "<!--@code-->": f'<script id="code">\n"use strict";\n(async () => {{\n{code}}})();\n</script>',
    }
    page = text_of(HERE / "page.html")
    for mark, content in parts.items():
        if page.count(mark) != 1:
            sys.exit(f"pack.py: page.html does not have {mark} once")
        page = page.replace(mark, content)
    pathlib.Path(out).write_text(page, encoding="utf-8")


main()
