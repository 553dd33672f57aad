#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""Prints the manual page of the layer, with the settings of settings_table.h.

usage: manual.py VERSION DATE
"""
import sys

import settings

LAYER = "VK_LAYER_VELLUM_opacity_micromap"
PAGE = r""".TH {title} 7 "{date}" "vellum {version}"
.SH NAME
{layer} \- opacity micromaps for Vulkan devices without them
.SH SYNOPSIS
\fBexport VK_INSTANCE_LAYERS={layer}\fR
.PP
\fBvellum run \-\-\fR \fIPROGRAM\fR
.SH DESCRIPTION
A Vulkan layer that provides VK_EXT_opacity_micromap, VK_KHR_opacity_micromap and VK_KHR_device_address_commands on drivers
with ray tracing that lack them. It is for development, tests and driver bring-up, not for speed.
.PP
The layer is explicit: it is active in programs that name it in ppEnabledLayerNames, or with the variable above. If the loader
does not find its manifest, set \fBVK_ADD_LAYER_PATH\fR to the folder share/vulkan/explicit_layer.d below its prefix.
.B vellum info
prints both commands, and what is missing if there are no micromaps.
.SH ENVIRONMENT
The same settings can be given by a file, without VELLUM_ and in small letters
(\fBvellum_opacity_micromap.report = warning\fR), and by VK_EXT_layer_settings.
{settings}.SH FILES
.TP
\fIprefix\fR/share/vulkan/explicit_layer.d/VkLayer_vellum_opacity_micromap.json
The manifest of the layer.
.TP
vk_layer_settings.txt
Settings: where \fBVK_LAYER_SETTINGS_PATH\fR says, in ~/.local/share/vulkan/settings.d, the working directory, or
/etc/vulkan/settings.d.
.TP
\fIprefix\fR/share/doc/vellum/docs/
The documents: using-the-layer.md, settings.md, validation.md, messages.md, limitations.md.
.SH SEE ALSO
.BR vellum (1),
.BR vellum\-info (1),
.BR vellum\-run (1),
.BR vulkaninfo (1)"""


def escaped(text):
    return text.replace("\\", "\\e").replace("-", "\\-").replace("'", "\\(aq")


def entry(setting):
    if setting["type"] in ("BOOL", "INT"):
        values = {"BOOL": "1|0", "INT": "number"}[setting["type"]]
    else:
        values = "|".join(flag["key"] for flag in setting.get("flags", ())) or setting["type"].split("_")[-1]
    default = setting["default"]
    if isinstance(default, bool):
        default = str(int(default))
    return (f".TP\n\\fB{setting['env']}\\fR=\\fI{values}\\fR{f' [{default}]' if default else ''}\n"
            f"{escaped(setting['description'])}\n")


def main():
    version, date = sys.argv[1:]
    print(PAGE.format(layer=LAYER, title=LAYER.upper(), version=version, date=date,
                      settings="".join(map(entry, settings.read()))))


if __name__ == "__main__":
    main()
