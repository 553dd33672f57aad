#!/usr/bin/env python3
"""Checks that the layer's manifest has the settings of the code, and docs/settings.md those of the manifest.

The code's are the rows of kRows in settings.cpp and the members of Settings in settings.h. The manifest has each with its
environment variable, type and default, for Vulkan Configurator. The table of the page is generated from the manifest: with
--write, it is written anew.

usage: check_settings.py [--write] [ROOT]
"""
import json
import re

import findings

CODE = "src/layer/base/settings.cpp"
HEADER = "src/layer/base/settings.h"
MANIFEST = "src/layer/entry/VkLayer_vellum_opacity_micromap.json.in"
PAGE = "docs/settings.md"
BEGIN, END = "<!-- begin settings -->\n", "<!-- end settings -->\n"
TYPES = {"bool": "BOOL", "ReportLevel": "ENUM", "std::string": "SAVE_FOLDER"}
DEFAULTS = {"true": True, "false": False, "ReportLevel::None": "none", None: ""}


def of_code(root):
    """Key: what the manifest is to say of it."""
    members = {name: (kind, default) for kind, name, default in re.findall(
        r"^    (bool|ReportLevel|std::string) (\w+)(?: = ([\w:]+))?;", (root / HEADER).read_text(encoding="utf-8"), re.M)}
    rows = re.findall(r'\{"(\w+)", &Settings::(\w+)\}', (root / CODE).read_text(encoding="utf-8"))
    def type_of(key, kind):
        return "SAVE_FILE" if key.endswith("_file") else TYPES[kind]
    return {key: ("VELLUM_" + key.upper(), type_of(key, members[member][0]), DEFAULTS[members[member][1] or None])
            for key, member in rows}


def settings_of_manifest(root):
    layer = json.loads((root / MANIFEST).read_text(encoding="utf-8"))["layer"]
    return layer["features"]["settings"]


def code(text):
    return f"`{text}`"


def values_of(row):
    if row["type"] == "BOOL":
        return code("true") + ", " + code("false")
    return ", ".join(code(flag["key"]) for flag in row.get("flags", ())) or "a " + row["type"].split("_")[-1].lower()


def default_of(row):
    if row["default"] == "":
        return "not set"
    return code(json.dumps(row["default"]).strip('"'))


def table(settings):
    lines = ["| environment variable | name in files and structures | values | default | meaning |", "|---|---|---|---|---|"]
    for row in settings:
        cells = (code(row["env"]), code(row["key"]), values_of(row), default_of(row), row["description"])
        lines.append("| " + " | ".join(cells) + " |")
    return "\n".join(lines) + "\n"


def generated(page, settings):
    before, rest = page.split(BEGIN)
    return before + BEGIN + table(settings) + END + rest.split(END)[1]


def write(root):
    page = root / PAGE
    page.write_text(generated(page.read_text(encoding="utf-8"), settings_of_manifest(root)), encoding="utf-8")


def check(root):
    settings = settings_of_manifest(root)
    manifest = {row["key"]: (row["env"], row["type"], row["default"]) for row in settings}
    code_has = of_code(root)
    found = [f"{MANIFEST}: {key} is {manifest.get(key, 'not there')}, in the code {code_has.get(key, 'not there')}"
             for key in sorted({*code_has, *manifest}) if code_has.get(key) != manifest.get(key)]
    page = (root / PAGE).read_text(encoding="utf-8")
    if page != generated(page, settings):
        found.append(f"{PAGE}: the table is stale; run tests/structure/check_settings.py --write")
    return found, len(code_has)


if __name__ == "__main__":
    findings.run(check, "settings", write)
