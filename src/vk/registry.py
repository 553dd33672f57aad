#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""Writes what Vellum knows of Vulkan's registry, vk.xml, into src/vk:

- structure_sizes.h: the size and name of every structure with an sType that applications fill in. The layer copies pNext chains
  of applications that are newer than the headers it was built with.
- enum_names.h: the names of values that messages have. NAMED lists their types.
- command_aliases.h: names of commands before they were promoted.
- newer.h: declarations that the oldest supported headers (1.3.239) lack, under their own names. NEWER lists them.

The files are committed; the registry is not needed to build. Run this when a new registry is out, or NEWER changes.
usage: registry.py vk.xml
"""
import pathlib
import re
import sys
import xml.etree.ElementTree as ElementTree

# Extension or version that declares it: what is declared, in the order of dependency. Structures come with the constant of
# their sType, enumerations with all their values.
NEWER = {
    "VK_KHR_maintenance5": """VkBufferUsageFlags2KHR VkBufferUsageFlags2CreateInfoKHR VkPipelineCreateFlags2KHR
        VkPipelineCreateFlags2CreateInfoKHR vkCmdBindIndexBuffer2KHR""",
    "VK_KHR_maintenance6": """VkPhysicalDeviceMaintenance6FeaturesKHR VkBindMemoryStatusKHR VkPushConstantsInfoKHR
        VkBindDescriptorSetsInfoKHR VkPushDescriptorSetInfoKHR VkPushDescriptorSetWithTemplateInfoKHR
        VkSetDescriptorBufferOffsetsInfoEXT VkBindDescriptorBufferEmbeddedSamplersInfoEXT vkCmdPushConstants2KHR
        vkCmdBindDescriptorSets2KHR vkCmdPushDescriptorSet2KHR vkCmdPushDescriptorSetWithTemplate2KHR
        vkCmdSetDescriptorBufferOffsets2EXT vkCmdBindDescriptorBufferEmbeddedSamplers2EXT""",
    "VK_VERSION_1_4": "VkPhysicalDeviceVulkan14Features",
    "VK_KHR_map_memory2": """VkMemoryMapInfoKHR VkMemoryUnmapFlagsKHR VkMemoryUnmapInfoKHR vkMapMemory2KHR
        vkUnmapMemory2KHR""",
    "VK_EXT_shader_object": """VkShaderEXT VkShaderCodeTypeEXT VkShaderCreateFlagsEXT VkShaderCreateInfoEXT
        VkPhysicalDeviceShaderObjectPropertiesEXT VK_INCOMPATIBLE_SHADER_BINARY_EXT vkCreateShadersEXT vkDestroyShaderEXT
        vkGetShaderBinaryDataEXT vkCmdBindShadersEXT""",
    "VK_KHR_pipeline_binary": """VK_KHR_PIPELINE_BINARY_EXTENSION_NAME VK_MAX_PIPELINE_BINARY_KEY_SIZE_KHR
        VK_PIPELINE_BINARY_MISSING_KHR VK_ERROR_NOT_ENOUGH_SPACE_KHR VkPipelineBinaryKHR
        VkPhysicalDevicePipelineBinaryFeaturesKHR VkPhysicalDevicePipelineBinaryPropertiesKHR VkPipelineBinaryKeyKHR
        VkPipelineBinaryDataKHR VkPipelineBinaryKeysAndDataKHR VkPipelineCreateInfoKHR VkPipelineBinaryCreateInfoKHR
        VkPipelineBinaryInfoKHR VkPipelineBinaryDataInfoKHR VkPipelineBinaryHandlesInfoKHR vkCreatePipelineBinariesKHR
        vkDestroyPipelineBinaryKHR vkGetPipelineKeyKHR vkGetPipelineBinaryDataKHR""",
    "VK_EXT_descriptor_heap": """VK_EXT_DESCRIPTOR_HEAP_EXTENSION_NAME VkHostAddressRangeConstEXT VkDeviceAddressRangeEXT
        VkBindHeapInfoEXT
        VkPushDataInfoEXT VkPhysicalDeviceDescriptorHeapFeaturesEXT VkCommandBufferInheritanceDescriptorHeapInfoEXT
        VK_PIPELINE_CREATE_2_DESCRIPTOR_HEAP_BIT_EXT vkCmdBindSamplerHeapEXT vkCmdBindResourceHeapEXT vkCmdPushDataEXT""",
    "VK_ARM_tensors": "VkTensorARM VkTensorMemoryBarrierARM VkTensorDependencyInfoARM",
    "VK_ARM_pipeline_opacity_micromap": """VK_ARM_PIPELINE_OPACITY_MICROMAP_EXTENSION_NAME
        VkPhysicalDevicePipelineOpacityMicromapFeaturesARM VK_PIPELINE_CREATE_2_DISALLOW_OPACITY_MICROMAP_BIT_ARM""",
    "VK_NV_displacement_micromap": """VK_NV_DISPLACEMENT_MICROMAP_EXTENSION_NAME
        VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_DISPLACEMENT_MICROMAP_FEATURES_NV VkPhysicalDeviceDisplacementMicromapPropertiesNV
        VK_STRUCTURE_TYPE_ACCELERATION_STRUCTURE_TRIANGLES_DISPLACEMENT_MICROMAP_NV""",
    "VK_KHR_internally_synchronized_queues": "VK_DEVICE_QUEUE_CREATE_INTERNALLY_SYNCHRONIZED_BIT_KHR",
    "VK_QCOM_queue_perf_hint": "VkPerfHintTypeQCOM VkPerfHintInfoQCOM vkQueueSetPerfHintQCOM",
    "VK_EXT_layer_settings": """VK_EXT_LAYER_SETTINGS_EXTENSION_NAME VkLayerSettingTypeEXT VkLayerSettingEXT
        VkLayerSettingsCreateInfoEXT""",
    "VK_EXT_device_generated_commands": """VkIndirectExecutionSetEXT VkIndirectCommandsLayoutEXT VkGeneratedCommandsInfoEXT
        vkCmdExecuteGeneratedCommandsEXT""",
    "VK_NV_device_generated_commands_compute": "vkGetPipelineIndirectMemoryRequirementsNV",
    "VK_QCOM_tile_shading": "VkDispatchTileInfoQCOM vkCmdDispatchTileQCOM",
    "VK_KHR_maintenance10": "VkRenderingEndInfoKHR vkCmdEndRendering2KHR",
}
NAMED = ("VkIndexType", "VkMicromapTypeEXT", "VkOpacityMicromapFormatEXT", "VkQueryType")
# The layer does not handle the pipelines of VK_NV_ray_tracing, so this one is a command of its own to it.
NO_ALIASES = {"vkGetRayTracingShaderGroupHandlesNV"}
WIDTHS = {"void": 1, "char": 1, "float": 4, "double": 8, "int": 4, "size_t": 8, "int8_t": 1, "uint8_t": 1, "int16_t": 2,
          "uint16_t": 2, "int32_t": 4, "uint32_t": 4, "int64_t": 8, "uint64_t": 8}
# Types of window systems and other interfaces, on 64-bit systems.
PLATFORM_WIDTHS = {"HANDLE": 8, "HINSTANCE": 8, "HWND": 8, "HMONITOR": 8, "LPCWSTR": 8, "DWORD": 4, "Window": 8, "VisualID": 8,
                   "xcb_window_t": 4, "xcb_visualid_t": 4, "RROutput": 8, "zx_handle_t": 4, "GgpStreamDescriptor": 4,
                   "GgpFrameToken": 8, "NvSciBufAttrList": 8, "NvSciBufObj": 8, "NvSciSyncAttrList": 8, "NvSciSyncObj": 8,
                   "ubm_device": 8, "ubm_surface": 8}


def for_vulkan(element, attribute="api"):
    names = (element.get(attribute) or "vulkan").split(",")
    return "vulkan" in names or "vulkanbase" in names


def text_of(element):
    """Declaration of a member or parameter, as it is in the headers."""
    parts = [element.text or ""]
    for child in element:
        if child.tag != "comment":
            parts.append("".join(child.itertext()))
        parts.append(child.tail or "")
    return re.sub(r"(\*+) *(\w+)( ?\[|$)", r"\1\2\3", re.sub(r"\s+", " ", "".join(parts)).strip().replace("* ", "*").replace(
        "*", " *")).replace("  ", " ").replace("* *", "**")


class Registry:
    """What vk.xml has for Vulkan, without what is disabled, provisional, or for Vulkan SC."""

    def __init__(self, path):
        root = ElementTree.parse(path).getroot()
        self.types = {}
        for node in root.findall("types/type"):
            name = node.get("name") or node.findtext("name") or node.findtext("proto/name")
            if for_vulkan(node) and name:
                self.types.setdefault(name, node)
        self.commands = {}
        for node in root.findall("commands/command"):
            if for_vulkan(node):
                self.commands.setdefault(node.get("name") or node.findtext("proto/name"), node)
        self.enums = {node.get("name"): node for node in root.findall("enums")}
        self.values = {}  # of constants
        self.names = {}  # of constants that are other names
        self.added = {}  # type of an enumeration: values that extensions add
        self.required = {}  # name: the first version or extension that requires it
        self.guarded = {}  # version or extension: what it requires
        self.provisional = set()
        for block in self.enums.values():
            for value in block.findall("enum"):
                self.add_value(value, None)
        for block in root.findall("feature") + root.findall("extensions/extension"):
            if not for_vulkan(block, "supported" if block.tag == "extension" else "api"):
                continue
            guard = re.sub("_(BASE|COMPUTE|GRAPHICS)_", "_", block.get("name"))  # the headers have one macro for the parts
            if block.get("provisional") == "true":
                self.provisional.add(guard)
            for part in block.findall("require"):
                if not for_vulkan(part):
                    continue
                for item in part:
                    if item.tag == "enum":
                        self.add_value(item, block.get("number"))
                        self.added.setdefault(item.get("extends"), []).append(item.get("name"))
                    if item.tag in ("type", "command", "enum") and for_vulkan(item):
                        self.guarded.setdefault(guard, []).append(item.get("name"))
                        self.required.setdefault(item.get("name"), guard)
        version = [node for node in root.findall("types/type") if node.findtext("name") == "VK_HEADER_VERSION"]
        complete = [node for node in root.findall("types/type") if node.findtext("name") == "VK_HEADER_VERSION_COMPLETE"]
        number = [node for node in version if for_vulkan(node)][0].find("name").tail.strip()
        minor = re.search(r"\d, (\d), (\d), VK_HEADER_VERSION",
                          "".join([node for node in complete if for_vulkan(node)][0].itertext()))
        self.version = f"{minor[1]}.{minor[2]}.{number}"

    def add_value(self, node, number):
        name = node.get("name")
        if not for_vulkan(node):
            return
        if node.get("alias"):
            self.names[name] = node.get("alias")
        elif node.get("bitpos"):
            self.values[name] = str(1 << int(node.get("bitpos")))
        elif node.get("offset"):
            value = 1000000000 + (int(node.get("extnumber") or number) - 1) * 1000 + int(node.get("offset"))
            self.values[name] = ("-" if node.get("dir") == "-" else "") + str(value)
        elif node.get("value"):
            self.values[name] = node.get("value")

    def value(self, name):
        while name in self.names:
            name = self.names[name]
        return self.values[name]

    def original(self, name, nodes):
        while nodes[name].get("alias"):
            name = nodes[name].get("alias")
        return name

    def layout(self, name):
        """Size and alignment of a type on 64-bit systems."""
        if name in WIDTHS:
            return WIDTHS[name], WIDTHS[name]
        if name in PLATFORM_WIDTHS:
            return PLATFORM_WIDTHS[name], PLATFORM_WIDTHS[name]
        name = self.original(name, self.types)
        node = self.types[name]
        category = node.get("category")
        if category in ("enum",) or name.startswith("StdVideo"):
            return 4, 4
        if category in ("handle", "funcpointer"):
            return 8, 8
        if category in ("basetype", "bitmask"):
            if "*" in "".join(node.itertext()):
                return 8, 8
            return self.layout(node.findtext("type"))
        if category not in ("struct", "union"):
            raise KeyError(name)
        size, alignment, bits = 0, 1, 0
        for member in node.findall("member"):
            if not for_vulkan(member):
                continue
            declaration = text_of(member)
            one, aligned = (8, 8) if "*" in declaration else self.layout(member.findtext("type"))
            alignment = max(alignment, aligned)
            field = re.search(r":(\d+)$", declaration.replace(" ", ""))
            if field:
                if bits % (8 * one) + int(field[1]) > 8 * one or bits == 0:
                    bits = 0
                    size = -(-size // aligned) * aligned + one
                bits = (bits + int(field[1])) % (8 * one)
                continue
            bits = 0
            for length in re.findall(r"\[(\w+)\]", declaration):
                one *= int(length if length.isdigit() else self.value(length).rstrip("U"))
            size = max(size, one) if category == "union" else -(-size // aligned) * aligned + one
        return -(-size // alignment) * alignment, alignment

    def s_type(self, name):
        """Constant for the sType of a structure; None if it has none."""
        node = self.types[name]
        member = node.find("member[name='sType']")
        return member.get("values") if node.get("category") == "struct" and member is not None else None

    def structures(self):
        """(value of sType, name, size) of every structure that a version or extension has, except those that drivers write."""
        rows = []
        for name, node in self.types.items():
            guard = self.required.get(name)
            if node.get("alias") or not guard or guard in self.provisional or not self.s_type(name):
                continue
            if node.get("returnedonly") == "true":
                continue
            rows.append((int(self.value(self.s_type(name))), name, self.layout(name)[0]))
        return sorted(rows)

    def enumerants(self, name):
        """(value, name) of every value of an enumeration."""
        own = [node.get("name") for node in self.enums[self.original(name, self.types)].findall("enum")]
        names = {value for value in own + self.added.get(self.original(name, self.types), []) if value in self.values}
        return sorted((int(self.value(value)), value) for value in names)

    def aliases(self):
        """Alias: the command."""
        return {name: self.original(name, self.commands) for name, node in sorted(self.commands.items())
                if node.get("alias") and name in self.required and name not in NO_ALIASES}


def head(registry, about):
    return (f"// SPDX-License-Identifier: Apache-2.0\n// Written by src/vk/registry.py from Vulkan's registry {registry.version}."
            f"\n// {about}\n#pragma once\n\n")


def structure_sizes(registry):
    rows = "".join(f'    {{{value}, {size}, "{name}"}},\n' for value, name, size in registry.structures())
    return head(registry, "The size and name of each structure with an sType that applications fill in, on systems of 64 bits.") + f"""#include <cstdint>

namespace vellum
{{

struct StructureSize {{
    int32_t type; // VkStructureType
    uint16_t bytes;
    const char *name;
}};
// Sorted by type. Structures of provisional extensions may change and are not here; those that only drivers write are
// in no chain that the layer copies.
// clang-format off
inline constexpr StructureSize kStructureSizes[] = {{
{rows}}};
// clang-format on

}} // namespace vellum
"""


def enum_names(registry):
    tables = ""
    for name in NAMED:
        rows = "".join(f'    {{{value}, "{constant}"}},\n' for value, constant in registry.enumerants(name))
        tables += f"inline constexpr EnumName k{name[2:]}Names[] = {{\n{rows}}};\n"
    return head(registry, "Names of values that messages have.") + f"""#include <cstdint>

namespace vellum
{{

struct EnumName {{
    int32_t value;
    const char *name;
}};
// clang-format off
{tables}// clang-format on

}} // namespace vellum
"""


def command_aliases(registry):
    rows = "".join(f'    {{"{alias}", "{command}"}},\n' for alias, command in registry.aliases().items())
    return head(registry, "Names of commands before they were promoted to another extension or to Vulkan itself.") + f"""\
namespace vellum
{{

struct CommandAlias {{
    const char *alias;
    const char *command;
}};
// Sorted by alias.
// clang-format off
inline constexpr CommandAlias kCommandAliases[] = {{
{rows}}};
// clang-format on

}} // namespace vellum
"""


class Declarations:
    """Declarations of one extension, with its own names for what later versions of Vulkan have."""

    def __init__(self, registry, guard):
        self.registry = registry
        names = registry.guarded[guard]
        self.renamed = {registry.original(name, registry.types): name for name in names
                        if name in registry.types and registry.types[name].get("alias")}
        self.constants = {registry.names[name]: name for name in names if name in registry.names}

    def of(self, text):
        return re.sub(r"\bVk\w+", lambda word: self.renamed.get(word[0], word[0]), text)

    def constant(self, name, kind):
        value = self.registry.value(name)
        return f"inline constexpr {kind} {name} = static_cast<{kind}>({value});\n"

    def declare(self, name):
        if name.startswith("VK_"):
            return self.declare_constant(name)
        if name.startswith("vk"):
            node = self.registry.commands[self.registry.original(name, self.registry.commands)]
            parameters = ", ".join(text_of(p) for p in node.findall("param") if for_vulkan(p))
            result = node.findtext("proto/type")
            return self.of(f"using PFN_{name} = {result}(VKAPI_PTR *)({parameters});\n")
        node = self.registry.types[self.registry.original(name, self.registry.types)]
        category = node.get("category")
        if category == "handle":
            return f"{node.findtext('type')}({name})\n"
        if category == "bitmask":
            return f"using {name} = {node.findtext('type')};\n"
        if category == "enum":
            values = self.registry.enums[node.get("name")].findall("enum")
            rows = "".join(f"    {v.get('name')} = {self.registry.value(v.get('name'))},\n" for v in values
                           if not v.get("alias"))
            return f"enum {name} : int {{\n{rows}}};\n"  # drivers return other values, too
        members = "".join(f"    {text_of(m)};\n" for m in node.findall("member") if for_vulkan(m))
        text = self.of(f"struct {name} {{\n{members}}};\n")
        constant = self.registry.s_type(node.get("name"))
        if constant:
            constant = self.constants.get(constant, constant)
            text = self.constant(constant, "VkStructureType") + text
        return text

    def declare_constant(self, name):
        if name.endswith("_EXTENSION_NAME"):
            return f"#define {name} {self.registry.value(name)}\n"
        if name.startswith("VK_MAX_"):
            return f"inline constexpr uint32_t {name} = {self.registry.value(name)};\n"
        if name.startswith("VK_STRUCTURE_TYPE"):
            return self.constant(name, "VkStructureType")
        if name.startswith("VK_PIPELINE_CREATE_2"):
            return self.constant(name, "VkFlags64")
        if name.startswith("VK_DEVICE_QUEUE_CREATE"):
            return self.constant(name, "VkDeviceQueueCreateFlagBits")
        return self.constant(name, "VkResult")


def newer(registry):
    text = ""
    for guard, names in NEWER.items():
        declarations = Declarations(registry, guard)
        text += f"#ifndef {guard}\n" + "".join(declarations.declare(name) for name in names.split()) + "#endif\n\n"
    return head(registry, "Vulkan's headers, and what of newer ones Vellum uses.") + f"""\
#include "vellum/vulkan_opacity_micromap.h"

// clang-format off
{text}// clang-format on
"""


def main():
    registry = Registry(sys.argv[1])
    folder = pathlib.Path(__file__).resolve().parent
    for name in ("structure_sizes", "enum_names", "command_aliases", "newer"):
        (folder / f"{name}.h").write_text(globals()[name](registry), encoding="utf-8")


if __name__ == "__main__":
    main()
