#!/usr/bin/env python3
"""Checks that the layer's manifest and docs/using.md have the settings that the code has, and prints what differs.

The code's are the rows of kRows in settings.cpp and the members of Settings in settings.h. The manifest has each with its
environment variable, type and default, for Vulkan Configurator; the page has its names.

usage: check_settings.py [ROOT]
"""
import json
import re

import findings

CODE = "src/layer/base/settings.cpp"
HEADER = "src/layer/base/settings.h"
MANIFEST = "src/layer/entry/VkLayer_vellum_opacity_micromap.json.in"
PAGE = "docs/using.md"
TYPES = {"bool": "BOOL", "ReportLevel": "ENUM", "std::string": "SAVE_FOLDER"}
DEFAULTS = {"true": True, "false": False, "ReportLevel::None": "none", None: ""}


def of_code(root):
    """Key: what the manifest is to say of it."""
    members = {name: (kind, default) for kind, name, default in re.findall(
        r"^    (bool|ReportLevel|std::string) (\w+)(?: = ([\w:]+))?;", (root / HEADER).read_text(encoding="utf-8"), re.M)}
    rows = re.findall(r'\{"(\w+)", &Settings::(\w+)\}', (root / CODE).read_text(encoding="utf-8"))
    return {key: ("VELLUM_" + key.upper(), TYPES[members[member][0]], DEFAULTS[members[member][1] or None])
            for key, member in rows}


def of_manifest(root):
    layer = json.loads((root / MANIFEST).read_text(encoding="utf-8"))["layer"]
    return {row["key"]: (row["env"], row["type"], row["default"]) for row in layer["features"]["settings"]}


def of_page(root):
    page = (root / PAGE).read_text(encoding="utf-8")
    return dict(re.findall(r"^\| `(VELLUM_\w+)=[^|]*\| `vellum_opacity_micromap\.(\w+) =", page, re.M))


def check(root):
    code, manifest, page = of_code(root), of_manifest(root), of_page(root)
    found = [f"{MANIFEST}: {key} is {manifest.get(key, 'not there')}, in the code {code.get(key, 'not there')}"
             for key in sorted({*code, *manifest}) if code.get(key) != manifest.get(key)]
    named = {key: variable for variable, key in page.items()}
    found += [f"{PAGE}: {key} is {named.get(key, 'not there')}, in the code {code.get(key, ['not there'])[0]}"
              for key in sorted({*code, *named}) if code.get(key, [None])[0] != named.get(key)]
    return found, len(code)


if __name__ == "__main__":
    findings.run(check, "settings")
