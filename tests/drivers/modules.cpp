// SPDX-License-Identifier: Apache-2.0
#include "modules.h"

#include <algorithm>
#include <map>
#include <stdexcept>

#include "spirv/module/numbers.h"
#include "spirv/module_file.h"

namespace vellum::test
{
namespace
{

// A shader that indexes an array without a length may reach this many.
constexpr uint32_t kRuntimeArray = 16;

VkShaderStageFlagBits stageOf(uint32_t model)
{
    switch (model) {
    case spv::ExecutionModelVertex: return VK_SHADER_STAGE_VERTEX_BIT;
    case spv::ExecutionModelFragment: return VK_SHADER_STAGE_FRAGMENT_BIT;
    case spv::ExecutionModelGLCompute: return VK_SHADER_STAGE_COMPUTE_BIT;
    case spv::ExecutionModelRayGenerationKHR: return VK_SHADER_STAGE_RAYGEN_BIT_KHR;
    case spv::ExecutionModelIntersectionKHR: return VK_SHADER_STAGE_INTERSECTION_BIT_KHR;
    case spv::ExecutionModelAnyHitKHR: return VK_SHADER_STAGE_ANY_HIT_BIT_KHR;
    case spv::ExecutionModelClosestHitKHR: return VK_SHADER_STAGE_CLOSEST_HIT_BIT_KHR;
    case spv::ExecutionModelMissKHR: return VK_SHADER_STAGE_MISS_BIT_KHR;
    case spv::ExecutionModelCallableKHR: return VK_SHADER_STAGE_CALLABLE_BIT_KHR;
    default: throw std::runtime_error("an entry point of stage " + std::to_string(model));
    }
}

using Instruction = std::span<const uint32_t>;

class Reader
{
public:
    explicit Reader(std::span<const uint32_t> words)
    {
        for (size_t at = 5; at < words.size(); at += words[at] >> 16)
            read(words.subspan(at, words[at] >> 16));
    }

    ModuleFacts facts()
    {
        for (const Instruction in : variables_) {
            const uint32_t storage = in[3];
            const bool resource = storage == spv::StorageClassUniformConstant || storage == spv::StorageClassUniform ||
                                  storage == spv::StorageClassStorageBuffer;
            if (resource && bindings_.contains(in[2]))
                facts_.bindings.push_back(describe(in));
        }
        return facts_;
    }

private:
    void read(Instruction in)
    {
        switch (in[0] & 0xffff) {
        case spv::OpEntryPoint:
            facts_.entryPoints.push_back({reinterpret_cast<const char *>(&in[3]), stageOf(in[1])});
            break;
        case spv::OpDecorate:
            if (in[2] == spv::DecorationBinding)
                bindings_[in[1]] = in[3];
            else if (in[2] == spv::DecorationDescriptorSet)
                sets_[in[1]] = in[3];
            else if (in[2] == spv::DecorationBufferBlock)
                bufferBlocks_[in[1]] = true;
            break;
        case spv::OpConstant:
        case spv::OpSpecConstant: values_[in[2]] = in[3]; break;
        case spv::OpVariable: variables_.push_back(in); break;
        case spv::OpTypePointer:
        case spv::OpTypeArray:
        case spv::OpTypeRuntimeArray:
        case spv::OpTypeStruct:
        case spv::OpTypeImage:
        case spv::OpTypeSampledImage:
        case spv::OpTypeSampler:
        case spv::OpTypeAccelerationStructureKHR: types_[in[1]] = in; break;
        default: break;
        }
    }

    Binding describe(Instruction variable)
    {
        Binding made{sets_[variable[2]], bindings_[variable[2]], VK_DESCRIPTOR_TYPE_STORAGE_BUFFER, 1};
        Instruction type = types_.at(types_.at(variable[1])[3]);
        for (; (type[0] & 0xffff) == spv::OpTypeArray || (type[0] & 0xffff) == spv::OpTypeRuntimeArray;
             type = types_.at(type[2]))
            made.count *= (type[0] & 0xffff) == spv::OpTypeArray ? values_.at(type[3]) : kRuntimeArray;
        switch (type[0] & 0xffff) {
        case spv::OpTypeAccelerationStructureKHR: made.type = VK_DESCRIPTOR_TYPE_ACCELERATION_STRUCTURE_KHR; break;
        case spv::OpTypeSampledImage: made.type = VK_DESCRIPTOR_TYPE_COMBINED_IMAGE_SAMPLER; break;
        case spv::OpTypeSampler: made.type = VK_DESCRIPTOR_TYPE_SAMPLER; break;
        case spv::OpTypeImage: // word 7: whether it is sampled (1) or stored to (2)
            made.type = type[7] == 2 ? VK_DESCRIPTOR_TYPE_STORAGE_IMAGE : VK_DESCRIPTOR_TYPE_SAMPLED_IMAGE;
            break;
        default:
            if (variable[3] == spv::StorageClassUniform && !bufferBlocks_.contains(type[1]))
                made.type = VK_DESCRIPTOR_TYPE_UNIFORM_BUFFER;
        }
        return made;
    }

    ModuleFacts facts_;
    std::vector<Instruction> variables_;
    std::map<uint32_t, Instruction> types_;
    std::map<uint32_t, uint32_t> bindings_, sets_, values_;
    std::map<uint32_t, bool> bufferBlocks_;
};

} // namespace

ModuleFacts factsOf(std::span<const uint32_t> words)
{
    return Reader(words).facts();
}

std::vector<ModuleFile> modulesIn(const std::filesystem::path &folder)
{
    std::vector<ModuleFile> all;
    for (const auto &entry : std::filesystem::directory_iterator(folder)) {
        if (isModuleFile(entry.path()))
            all.push_back({entry.path().stem().string(), readModule(entry.path())});
    }
    if (all.empty())
        throw std::runtime_error("no SPIR-V modules in " + folder.string());
    std::ranges::sort(all, {}, &ModuleFile::name);
    return all;
}

} // namespace vellum::test
