// SPDX-License-Identifier: Apache-2.0
// The facts about a SPIR-V module that are needed to create a pipeline of it.
#pragma once

#include <cstdint>
#include <filesystem>
#include <span>
#include <string>
#include <vector>

#include <vulkan/vulkan.h>

namespace vellum::test
{

struct Binding {
    uint32_t set = 0, binding = 0;
    VkDescriptorType type{};
    uint32_t count = 1;
};

struct EntryPoint {
    std::string name;
    VkShaderStageFlagBits stage{};
};

struct ModuleFacts {
    std::vector<EntryPoint> entryPoints;
    std::vector<Binding> bindings;
};

// `words`: a valid module.
ModuleFacts factsOf(std::span<const uint32_t> words);

// A file that spirv/module_file.h reads.
struct ModuleFile {
    std::string name;
    std::vector<uint32_t> words;
};

// Sorted by name. Throws if there are none.
std::vector<ModuleFile> modulesIn(const std::filesystem::path &folder);

} // namespace vellum::test
