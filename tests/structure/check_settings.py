#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""Checks that the layer's manifest has the settings of the table in the code, and docs/settings.md as well.

The table is settings_table.h; the manifest gets it when the build is configured. The table of the page is generated from
it: with --write, it is written anew. Values that documents give to settings ("VELLUM_REPORT=error") are those of the table.

usage: check_settings.py [--write] [ROOT]
"""
import json
import pathlib
import re
import sys

import findings

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parents[2] / "src/layer/base"))
import settings  # noqa: E402

CODE = "src/layer/base/settings_table.h"
MANIFEST = "src/layer/entry/VkLayer_vellum_opacity_micromap.json.in"
PAGE = "docs/settings.md"
BEGIN, END = "<!-- begin settings -->\n", "<!-- end settings -->\n"


def of_manifest(root, rows):
    """The settings of the manifest as the build configures it."""
    text = (root / MANIFEST).read_text(encoding="utf-8").replace("@VELLUM_SETTINGS@", json.dumps(rows))
    return {row["key"]: row for row in json.loads(text)["layer"]["features"]["settings"]}


def code(text):
    return f"`{text}`"


def values_of(row):
    if row["type"] == "BOOL":
        return code("true") + ", " + code("false")
    if row["type"] == "INT":
        return "a number"
    return ", ".join(code(flag["key"]) for flag in row.get("flags", ())) or "a " + row["type"].split("_")[-1].lower()


def default_of(row):
    if row["default"] in ("", []):
        return "not set"
    return code(json.dumps(row["default"]).strip('"'))


def table(rows):
    lines = ["| environment variable | name in files and structures | values | default | meaning |", "|---|---|---|---|---|"]
    for row in rows:
        cells = (code(row["env"]), code(row["key"]), values_of(row), default_of(row), row["description"])
        lines.append("| " + " | ".join(cells) + " |")
    return "\n".join(lines) + "\n"


def generated(page, rows):
    before, rest = page.split(BEGIN)
    return before + BEGIN + table(rows) + END + rest.split(END)[1]


def write(root):
    page = root / PAGE
    page.write_text(generated(page.read_text(encoding="utf-8"), settings.read(root / CODE)), encoding="utf-8")


def is_value(row, value):
    if row["type"] == "BOOL":
        return value in ("0", "1", "true", "false")
    if row["type"] == "INT":
        return value.isdigit()
    names = {flag["key"] for flag in row.get("flags", ())}
    if row["type"] == "FLAGS":
        return value == "all" or set(value.split(",")) <= names
    return not names or value in names


def wrong_values(root, rows):
    """In the documents, of the settings of the table."""
    by_name = {row["env"]: row for row in rows}
    for page in sorted({*root.glob("*.md"), *root.glob("docs/**/*.md"), *root.glob(".github/**/*.md")}):
        for name, value in re.findall(r"\b(VELLUM_[A-Z0-9_]+)=([\w,/.-]+)", page.read_text(encoding="utf-8")):
            if name in by_name and not is_value(by_name[name], value.rstrip(",.")):
                yield f"{page.relative_to(root)}: {name} has no value {value}"


def check(root):
    rows = settings.read(root / CODE)
    code_has, manifest = {row["key"]: row for row in rows}, of_manifest(root, rows)
    found = [f"{CODE}: {row['key']} has no {what}" for row in rows for what in ("label", "description") if not row[what]]
    found += [f"{MANIFEST}: {key} is {manifest.get(key, 'not there')}, in the code {code_has.get(key, 'not there')}"
              for key in sorted({*code_has, *manifest}) if code_has.get(key) != manifest.get(key)]
    text = (root / CODE).read_text(encoding="utf-8").replace("\\\n", "\n")
    written = len(re.findall(r"^    X\(", text, re.M)) - len(settings.VALUE.findall(text))
    if written != len(rows):
        found.append(f"{CODE}: {written} settings, of which settings.py understands {len(rows)}")
    page = (root / PAGE).read_text(encoding="utf-8")
    if page != generated(page, rows):
        found.append(f"{PAGE}: the table is stale; run tests/structure/check_settings.py --write")
    found += wrong_values(root, rows)
    return found, len(rows)


if __name__ == "__main__":
    findings.run(check, "settings", write)
