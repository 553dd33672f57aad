#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""Reads Vulkan's headers and writes what the recorder needs to know of acceleration structures, micromaps and ray tracing
pipelines: C++ that visits every member of every structure that a command takes, and a list of all members and values.

usage: generate.py OUT.inc OUT.json HEADER...

The list has "members", each with its type, "values" of the enumerations and flags that these extensions declare or extend, each
with the "other names" of a value, and "commands". The same of older and newer headers, but for what newer ones add.
"""
import json
import re
import sys

EXTENSIONS = {"VK_KHR_acceleration_structure", "VK_EXT_opacity_micromap", "VK_KHR_opacity_micromap",
              "VK_KHR_ray_tracing_pipeline", "VK_KHR_ray_tracing_maintenance1"}
# Structures and commands of other extensions and of core.
STRUCTURES = re.compile(r"VkAccelerationStructure\w*KHR$|VkStridedDeviceAddressRegionKHR$|VkQueryPoolCreateInfo$|VkTransformMatrixKHR$|VkAabbPositionsKHR$")
COMMANDS = {"vkCreateQueryPool", "vkGetQueryPoolResults", "vkCmdCopyQueryPoolResults", "vkCmdResetQueryPool", "vkResetQueryPool",
            "vkCreateAccelerationStructure2KHR", "vkGetRayTracingShaderGroupHandlesKHR"}
# Enumerations of core whose values are listed as far as this pattern goes.
CORE_VALUES = {"VkIndexType": re.compile(r"VK_INDEX_TYPE_(?!NONE_NV)"),
               "VkQueryType": re.compile(r"VK_QUERY_TYPE_(ACCELERATION_STRUCTURE|MICROMAP)_(?!\w*NV)"),
               "VkQueryResultFlagBits": re.compile(r"VK_QUERY_RESULT_\w+_BIT$")}
# Values that older headers lack.
NEWER = {"VkBuildAccelerationStructureFlagBitsKHR": {"VK_BUILD_ACCELERATION_STRUCTURE_ALLOW_DATA_ACCESS_BIT_KHR": 0x800}}
# Structures that the device fills in.
OUTPUT = re.compile(r"Properties(KHR|EXT)$|Features(KHR|EXT)$|SizesInfo(KHR|EXT)$")
COUNT_OF = {"pGeometries": "geometryCount", "ppGeometries": "geometryCount", "pUsageCounts": "usageCountsCount",
            "ppUsageCounts": "usageCountsCount", "pStages": "stageCount", "pGroups": "groupCount", "pInfos": "infoCount",
            "pCreateInfos": "createInfoCount"}
ONE = re.compile(r"p(Info|CreateInfo|BuildInfo|VersionInfo|LibraryInfo|LibraryInterface|\w*BindingTable)$")
NUMBERS = {"uint32_t", "uint64_t", "uint16_t", "uint8_t", "size_t", "VkDeviceSize", "int32_t"}
MEMBER = re.compile(r"(?P<const>const\s+)?(?P<type>\w+)\s*(?P<pointer>\*(?:\s*const\s*\*)?)?\s*(?P<name>\w+)"
                    r"(?P<array>(?:\[\w+\])*)(?:\s*:\s*\d+)?$")


class Headers:
    def __init__(self, texts):
        self.structures, self.unions, self.enumerations, self.commands = {}, set(), {}, {}
        self.handles, self.flags, self.aliases, self.section = set(), {}, {}, {}
        for text in texts:
            self.read(re.sub(r"\\\n", " ", text))
        for name, values in NEWER.items():
            self.enumerations[name].update(values)

    def read(self, text):
        section = "VK_VERSION_1_0"
        pattern = re.compile(
            r"^#define (?P<section>VK_[A-Z]+_(?:[a-z]\w*|\d+_\d+)) 1\b"
            r"|^typedef (?P<kind>struct|union|enum) (?P<name>\w+) \{(?P<body>.*?)\n\} \w+;"
            r"|^VK_DEFINE_\w*HANDLE\((?P<handle>\w+)\)"
            r"|^typedef VkFlags(?P<wide>64)? (?P<flags>Vk\w+);"
            r"|^typedef (?P<original>Vk\w+) (?P<alias>Vk\w+);"
            r"|^typedef \w+\s*\(VKAPI_PTR \*PFN_(?P<command>vk\w+)\)\((?P<parameters>.*?)\);"
            r"|^#define (?P<value>VK_\w+)\s+VELLUM_VULKAN_VALUE\((?P<type>\w+), (?P<number>-?\w+)\)", re.M | re.S)
        for found in pattern.finditer(text):
            if found["section"]:
                section = found["section"]
            elif found["kind"] == "enum":
                values = self.enumerations.setdefault(found["name"], {})
                for name, number in re.findall(r"(VK_\w+) = (-?\w+),?$", found["body"], re.M):
                    if "MAX_ENUM" not in name:
                        values[name] = values[number] if number.startswith("VK_") else int(number, 0)
                self.section.setdefault(found["name"], section)
            elif found["kind"]:
                members = [MEMBER.match(" ".join(line.split())) for line in found["body"].split(";")]
                self.structures.setdefault(found["name"], [member for member in members if member])
                self.section.setdefault(found["name"], section)
                if found["kind"] == "union":
                    self.unions.add(found["name"])
            elif found["handle"]:
                self.handles.add(found["handle"])
            elif found["flags"]:
                self.flags[found["flags"]] = re.sub(r"Flags(\d?)", r"FlagBits\1", found["flags"])
            elif found["alias"]:
                # Either name of a pair may be the alias, in Vulkan's header and in Vellum's; the first header decides.
                if self.resolved(found["original"]) != found["alias"]:
                    self.aliases.setdefault(found["alias"], found["original"])
            elif found["command"]:
                self.commands.setdefault(found["command"], [MEMBER.match(" ".join(each.split()))
                                                           for each in found["parameters"].split(",")])
                self.section.setdefault(found["command"], section)
            elif found["value"]:
                self.enumerations.setdefault(found["type"], {}).setdefault(found["value"], int(found["number"], 0))

    def resolved(self, name):
        while name in self.aliases:
            name = self.aliases[name]
        return name

    def wanted(self, name):
        return (self.section.get(name) in EXTENSIONS or STRUCTURES.match(name)) and not OUTPUT.search(name)


class Writer:
    def __init__(self, headers):
        self.headers, self.members, self.lines = headers, {}, []

    def kind_of(self, member):
        """How a member is recorded, and the enumeration of its values."""
        name = self.headers.resolved(member["type"])
        if member["pointer"]:
            return "pointer", None
        if name == "VkBool32":
            return "number", None
        if name in self.headers.flags:
            return "flags", self.headers.flags[name]
        if name in self.headers.enumerations:
            return "value", name
        if name in self.headers.handles:
            return "handle", None
        if name == "VkDeviceAddress" or name.startswith("VkDeviceOrHostAddress"):
            return "address", None
        if name in NUMBERS:
            return "number", None
        if name == "float":
            return "real", None
        return None, None

    def record(self, owner, member, prefix="s."):
        """Lines of C++ that record a member or a parameter."""
        name, type_name = member["name"], self.headers.resolved(member["type"])
        if name in ("sType", "pNext", "pAllocator"):
            return
        kind, enumeration = self.kind_of(member)
        key, expression = f"{owner}.{name}", prefix + name
        if kind:
            self.members[key] = {"kind": kind, "type": member["type"]}
            if enumeration:
                self.members[key]["values"] = enumeration
            if kind == "address" and type_name in self.headers.unions:
                expression += ".deviceAddress"
            if member["array"]:
                expression = "&" + prefix + name + "[0]" * member["array"].count("[")
                self.lines.append(f'    noteArray("{key}", {expression}, sizeof {prefix}{name} / sizeof *({expression}));')
            else:
                self.lines.append(f'    note{kind.title()}("{key}", {expression});')
        if type_name in self.headers.structures and (self.headers.wanted(type_name) or type_name in self.headers.unions):
            self.descend(name, prefix, member["pointer"], type_name)

    def descend(self, name, prefix, pointer, type_name):
        if type_name in self.headers.unions:
            if "Address" not in type_name:
                self.lines.append(f"    visitChosen({prefix}geometryType, {prefix}{name});")
        elif not pointer:
            self.lines.append(f"    visit({prefix}{name});")
        elif name in COUNT_OF:
            self.lines.append(f"    visitAll({prefix}{name}, {prefix}{COUNT_OF[name]});")
        elif ONE.match(name):
            self.lines.append(f"    visitAll({prefix}{name}, 1);")

    def write(self):
        structures = [name for name in self.headers.structures
                      if self.headers.wanted(name) and name not in self.headers.unions]
        commands = [name for name, parameters in self.headers.commands.items()
                    if (self.headers.section[name] in EXTENSIONS or name in COMMANDS)
                    and parameters[0]["type"] in ("VkDevice", "VkCommandBuffer")]
        chained = [name for name in structures if any(member["name"] == "pNext" for member in self.headers.structures[name])]
        self.lines.append("// Generated by tests/layer/recorder/generate.py.")
        self.lines += [f"[[maybe_unused]] void visitMembers(const {name} &s);" for name in structures]
        self.lines.append("void visitChain(const void *chain);\n"
                          "template <class T>\nvoid visit(const T &s)\n{\n    visitMembers(s);\n"
                          "    if constexpr (requires { s.pNext; })\n        visitChain(s.pNext);\n}")
        self.lines.append("void visitChain(const void *chain)\n{\n"
                          "    for (const auto *s = static_cast<const VkBaseInStructure *>(chain); s != nullptr; s = s->pNext) {\n"
                          "        switch (static_cast<uint32_t>(s->sType)) {")
        for name in chained:
            self.lines.append(f"        case StructureType<{name}>::value: visitMembers(*reinterpret_cast<const {name} *>(s)); break;")
        self.lines.append("        default: break;\n        }\n    }\n}")
        for name in structures:
            self.lines.append(f"void visitMembers([[maybe_unused]] const {name} &s)\n{{\n    used(\"{name}\");")
            for member in self.headers.structures[name]:
                self.record(name, member)
            self.lines.append("}")
        for name in commands:
            self.command(name)
        rows = [f'    {{"{name}", DRIVER_FUNCTION({name}Recorded)}},' for name in commands]
        self.lines.append("const Row kRows[]{\n" + "\n".join(rows) + "\n    RECORDER_ROWS\n};")
        return commands, structures

    def command(self, name):
        parameters = self.headers.commands[name]
        text = ", ".join(f"{p['const'] or ''}{p['type']} {p['pointer'] or ''}{p['name']}" for p in parameters)
        self.lines.append(f"VKAPI_ATTR auto VKAPI_CALL {name}Recorded({text})\n{{\n    const auto handle = {parameters[0]['name']};\n    const std::lock_guard lock(mutex);\n    used(\"{name}\");")
        for parameter in parameters[1:]:
            if parameter["const"] or not parameter["pointer"]: # not what the command fills in
                self.record(name, parameter, prefix="")
        names = [p["name"] for p in parameters]
        if "ppBuildRangeInfos" in names:
            self.lines.append("    visitRanges(infoCount, pInfos, ppBuildRangeInfos);")
        if name in ("vkCmdBuildMicromapsEXT", "vkBuildMicromapsEXT"):
            self.lines.append("    visitMicromaps(infoCount, pInfos);")
        if name.startswith("vkCmdTraceRaysIndirect"):
            structure = "VkTraceRaysIndirectCommand2KHR" if "2" in name else "VkTraceRaysIndirectCommandKHR"
            self.lines.append(f"    visitMemory<{structure}>(indirectDeviceAddress, 0, 1);")
        if name == "vkCmdBuildAccelerationStructuresIndirectKHR":
            self.lines.append("    visitIndirectRanges(infoCount, pInfos, pIndirectDeviceAddresses, pIndirectStrides);")
        if not name.startswith("vkCmd"):
            self.lines.append("    readMemory();")
        self.lines.append(f"    return unlocked(DRIVER_NEXT({name}), {', '.join(names)});\n}}")

    def listed(self, structures):
        """The values of each enumeration that a member has, as far as they belong here, and their other names."""
        values, others = {}, {}
        for name in sorted({member["values"] for member in self.members.values() if "values" in member}):
            found = self.headers.enumerations.get(name, {})
            if name.endswith(("KHR", "EXT")):
                values[name] = found
            elif name in CORE_VALUES:
                values[name] = {value: number for value, number in found.items() if CORE_VALUES[name].match(value)}
            else:
                values[name] = {value: number for value, number in found.items()
                                if re.search("MICROMAP|RAY_TRACING", value) and not re.search("_NV$|DISPLACEMENT|MOTION", value)}
        for name, numbers in values.items(): # one name of each value, without vendors'
            by_number = {}
            for value, number in numbers.items():
                if not re.search(r"_NV$|_AMDX?$|_ARM$|_HUAWEI$", value):
                    by_number.setdefault(number, []).append(value)
            values[name] = {names[0]: number for number, names in by_number.items()}
            others.update({names[0]: names[1:] for names in by_number.values() if len(names) > 1})
        return {"values": values, "other names": others}


def main():
    out, listing, *paths = sys.argv[1:]
    headers = Headers([open(path, encoding="utf-8").read() for path in paths])
    writer = Writer(headers)
    commands, structures = writer.write()
    with open(out, "w", encoding="utf-8") as file:
        file.write("\n".join(writer.lines) + "\n")
    with open(listing, "w", encoding="utf-8") as file:
        json.dump({"members": writer.members, **writer.listed(structures), "commands": commands,
                   "structures": structures}, file, indent=1)


if __name__ == "__main__":
    main()
