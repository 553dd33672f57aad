#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""Reads the table of settings (settings_table.h), and prints it as the JSON of the manifest's `features.settings`.

usage: settings.py [TABLE]
"""
import json
import pathlib
import re
import sys

TABLE = pathlib.Path(__file__).with_name("settings_table.h")
TEXT = r'((?:"[^"]*"\s*)+)'
SETTING = re.compile(r'X\((\w+), (\w+), ([\w:]+), ([\w:{}]+),\s*' + TEXT + r',\s*' + TEXT + r'\)')
VALUE = re.compile(r'X\((\w+), (\w+),\s*' + TEXT + r',\s*' + TEXT + r'\)')
# The lists of their values.
VALUES = {"ReportLevel": "VELLUM_REPORT_LEVELS", "Preferred": "VELLUM_IMPLEMENTATIONS", "Checks": "VELLUM_CHECKS"}
# A path is a file if its key ends so, else a folder.
TYPES = {"bool": "BOOL", "uint32_t": "INT", "Checks": "FLAGS", "ReportLevel": "ENUM", "Preferred": "ENUM"}
DEFAULTS = {"true": True, "false": False, "{}": ""}


def joined(literals):
    """The text of adjacent string literals."""
    return "".join(re.findall(r'"([^"]*)"', literals))


def read(table=TABLE):
    """The settings as the manifest has them."""
    text = pathlib.Path(table).read_text(encoding="utf-8").replace("\\\n", "\n")
    flags, names = {}, {}
    for kind, macro in VALUES.items():
        values = VALUE.findall(text.split(f"#define {macro}(X)")[1].split("#define")[0])
        flags[kind] = [{"key": name, "label": joined(label), "description": joined(description)}
                       for name, _, label, description in values]
        names |= {f"{kind}::{value}": name for name, value, _, _ in values}
    settings = []
    for key, _, kind, default, label, description in SETTING.findall(text):
        path = "SAVE_FILE" if key.endswith("_file") else "SAVE_FOLDER"
        setting = {"key": key, "env": "VELLUM_" + key.upper(), "label": joined(label),
                   "description": joined(description), "type": TYPES.get(kind, path)}
        setting["default"] = int(default) if kind == "uint32_t" else [] if kind == "Checks" else (DEFAULTS | names)[default]
        settings.append(setting | ({"flags": flags[kind]} if kind in flags else {}))
    return settings


def main():
    print(json.dumps(read(*sys.argv[1:2]), indent=2))


if __name__ == "__main__":
    main()
