// SPDX-License-Identifier: Apache-2.0
// VK_EXT_device_generated_commands, which the oldest supported headers do not know: its declarations under names of our
// own, and its objects.
#pragma once

#include <type_traits>

#include "harness/harness.h"

namespace vt
{

enum class Token : uint32_t { ExecutionSet = 0, PushConstant = 1, Dispatch = 9, TraceRays2 = 1000386004 };

namespace generated // layouts and values: vk.xml
{

using Handle = uint64_t; // of an execution set or a layout of commands

struct PipelineSetInfo { // VkIndirectExecutionSetPipelineInfoEXT
    uint32_t sType = 1000572010;
    const void *pNext = nullptr;
    VkPipeline initialPipeline;
    uint32_t maxPipelineCount;
};
struct ShaderSetLayoutInfo { // VkIndirectExecutionSetShaderLayoutInfoEXT
    uint32_t sType = 1000572012;
    const void *pNext = nullptr;
    uint32_t setLayoutCount = 0;
    const VkDescriptorSetLayout *pSetLayouts = nullptr;
};
struct ShaderSetInfo { // VkIndirectExecutionSetShaderInfoEXT
    uint32_t sType = 1000572011;
    const void *pNext = nullptr;
    uint32_t shaderCount;
    const uint64_t *pInitialShaders;
    const ShaderSetLayoutInfo *pSetLayoutInfos;
    uint32_t maxShaderCount;
    uint32_t pushConstantRangeCount;
    const VkPushConstantRange *pPushConstantRanges;
};
struct SetCreateInfo { // VkIndirectExecutionSetCreateInfoEXT
    uint32_t sType = 1000572003;
    const void *pNext = nullptr;
    uint32_t type; // 0: pipelines, 1: shader objects
    const void *info;
};
struct SetWrite { // VkWriteIndirectExecutionSetPipelineEXT, and with a VkShaderEXT ...ShaderEXT
    uint32_t sType;
    const void *pNext = nullptr;
    uint32_t index;
    uint64_t object;
};
struct ExecutionSetToken { // VkIndirectCommandsExecutionSetTokenEXT
    uint32_t type;
    VkShaderStageFlags shaderStages;
};
struct LayoutToken { // VkIndirectCommandsLayoutTokenEXT
    uint32_t sType = 1000572007;
    const void *pNext = nullptr;
    Token type;
    const void *data;
    uint32_t offset;
};
struct LayoutCreateInfo { // VkIndirectCommandsLayoutCreateInfoEXT
    uint32_t sType = 1000572006;
    const void *pNext = nullptr;
    VkFlags flags;
    VkShaderStageFlags shaderStages;
    uint32_t indirectStride;
    VkPipelineLayout pipelineLayout;
    uint32_t tokenCount;
    const LayoutToken *pTokens;
};
struct CommandsInfo { // VkGeneratedCommandsInfoEXT
    uint32_t sType = 1000572004;
    const void *pNext = nullptr;
    VkShaderStageFlags shaderStages;
    Handle indirectExecutionSet;
    Handle indirectCommandsLayout;
    VkDeviceAddress indirectAddress;
    VkDeviceSize indirectAddressSize;
    VkDeviceAddress preprocessAddress;
    VkDeviceSize preprocessSize;
    uint32_t maxSequenceCount;
    VkDeviceAddress sequenceCountAddress;
    uint32_t maxDrawCount;
};
struct MemoryInfo { // VkGeneratedCommandsMemoryRequirementsInfoEXT
    uint32_t sType = 1000572002;
    const void *pNext = nullptr;
    Handle indirectExecutionSet;
    Handle indirectCommandsLayout;
    uint32_t maxSequenceCount;
    uint32_t maxDrawCount;
};
struct PipelineInfo { // VkGeneratedCommandsPipelineInfoEXT, and with shaders ...ShaderInfoEXT
    uint32_t sType = 1000572013;
    const void *pNext = nullptr;
    VkPipeline pipeline;
};

inline constexpr VkFlags64 kIndirectBindableBit = VkFlags64{1} << 38; // of pipelines
inline constexpr VkFlags kIndirectBindableShaderBit = 0x80;           // of shader objects
inline constexpr VkFlags kExplicitPreprocessBit = 1;                  // of layouts
inline constexpr VkFlags64 kPreprocessBufferBit = VkFlags64{1} << 31; // of buffers

struct Commands {
    explicit Commands(const Gpu &gpu)
    {
        const auto load = [&gpu](auto &function, const char *name) {
            function =
                reinterpret_cast<std::remove_reference_t<decltype(function)>>(vkGetDeviceProcAddr(gpu.device(), name));
        };
        load(memoryRequirements, "vkGetGeneratedCommandsMemoryRequirementsEXT");
        load(preprocess, "vkCmdPreprocessGeneratedCommandsEXT");
        load(execute, "vkCmdExecuteGeneratedCommandsEXT");
        load(createLayout, "vkCreateIndirectCommandsLayoutEXT");
        load(destroyLayout, "vkDestroyIndirectCommandsLayoutEXT");
        load(createSet, "vkCreateIndirectExecutionSetEXT");
        load(destroySet, "vkDestroyIndirectExecutionSetEXT");
        load(updatePipelines, "vkUpdateIndirectExecutionSetPipelineEXT");
        load(updateShaders, "vkUpdateIndirectExecutionSetShaderEXT");
    }
    void(VKAPI_PTR *memoryRequirements)(VkDevice, const MemoryInfo *, VkMemoryRequirements2 *);
    void(VKAPI_PTR *preprocess)(VkCommandBuffer, const CommandsInfo *, VkCommandBuffer);
    void(VKAPI_PTR *execute)(VkCommandBuffer, VkBool32, const CommandsInfo *);
    VkResult(VKAPI_PTR *createLayout)(VkDevice, const LayoutCreateInfo *, const VkAllocationCallbacks *, Handle *);
    void(VKAPI_PTR *destroyLayout)(VkDevice, Handle, const VkAllocationCallbacks *);
    VkResult(VKAPI_PTR *createSet)(VkDevice, const SetCreateInfo *, const VkAllocationCallbacks *, Handle *);
    void(VKAPI_PTR *destroySet)(VkDevice, Handle, const VkAllocationCallbacks *);
    void(VKAPI_PTR *updatePipelines)(VkDevice, Handle, uint32_t, const SetWrite *);
    void(VKAPI_PTR *updateShaders)(VkDevice, Handle, uint32_t, const SetWrite *);
};

} // namespace generated

// An execution set of compute pipelines or of compute shader objects.
class ExecutionSet
{
public:
    ExecutionSet(Gpu &gpu, std::span<const VkPipeline> pipelines) : gpu_(gpu), vk_(gpu)
    {
        const generated::PipelineSetInfo info{.initialPipeline = pipelines[0],
                                              .maxPipelineCount = static_cast<uint32_t>(pipelines.size())};
        create(0, &info);
        for (uint32_t i = 0; i < pipelines.size(); ++i) {
            const generated::SetWrite write{
                .sType = 1000572008, .index = i, .object = reinterpret_cast<uint64_t>(pipelines[i])};
            vk_.updatePipelines(gpu.device(), handle_, 1, &write);
        }
    }
    ExecutionSet(Gpu &gpu, std::span<const uint64_t> shaders, VkDescriptorSetLayout set,
                 const VkPushConstantRange &push)
        : gpu_(gpu), vk_(gpu)
    {
        const generated::ShaderSetLayoutInfo sets{.setLayoutCount = 1, .pSetLayouts = &set};
        const generated::ShaderSetInfo info{.shaderCount = 1,
                                            .pInitialShaders = shaders.data(),
                                            .pSetLayoutInfos = &sets,
                                            .maxShaderCount = static_cast<uint32_t>(shaders.size()),
                                            .pushConstantRangeCount = 1,
                                            .pPushConstantRanges = &push};
        create(1, &info);
        for (uint32_t i = 0; i < shaders.size(); ++i) {
            const generated::SetWrite write{.sType = 1000572009, .index = i, .object = shaders[i]};
            vk_.updateShaders(gpu.device(), handle_, 1, &write);
        }
    }
    ExecutionSet(const ExecutionSet &) = delete;
    ExecutionSet &operator=(const ExecutionSet &) = delete;
    ~ExecutionSet() { vk_.destroySet(gpu_.device(), handle_, nullptr); }
    [[nodiscard]] generated::Handle handle() const { return handle_; }

private:
    void create(uint32_t type, const void *info)
    {
        const generated::SetCreateInfo create{.type = type, .info = info};
        VT_CHECK(vk_.createSet(gpu_.device(), &create, nullptr, &handle_));
    }

    Gpu &gpu_;
    generated::Commands vk_;
    generated::Handle handle_ = 0;
};

// Sequences of commands in a buffer, with their layout and the memory to prepare them in.
class GeneratedCommands
{
public:
    struct Setup {
        VkPipelineLayout layout = VK_NULL_HANDLE;
        VkShaderStageFlags stages = 0;
        const ExecutionSet *set = nullptr;    // the sequences begin with an index into it: shader objects, pipelines
        bool shaderObjects = false;           // contents of the set
        VkPipeline pipeline = VK_NULL_HANDLE; // without a set
        const void *shaderInfo = nullptr;     // of bound shader objects, without either
        VkPushConstantRange push{};           // of a size: what comes next
        Token last = Token::Dispatch;         // and then this, of this size
        uint32_t lastBytes = 12;
        bool preprocess = false; // by a command of its own
    };
    // `sequences`: one after the other, all of the same size.
    GeneratedCommands(Gpu &gpu, const Setup &setup, std::span<const uint32_t> sequences)
        : gpu_(gpu), vk_(gpu), setup_(setup), input_(gpu.upload(sequences, VK_BUFFER_USAGE_INDIRECT_BUFFER_BIT))
    {
        const generated::ExecutionSetToken set{setup.shaderObjects ? 1u : 0u, setup.stages};
        std::vector<generated::LayoutToken> tokens;
        uint32_t stride = 0;
        if (setup.set != nullptr) {
            tokens.push_back({.type = Token::ExecutionSet, .data = &set, .offset = 0});
            stride += 4;
        }
        if (setup.push.size != 0) {
            tokens.push_back({.type = Token::PushConstant, .data = &setup.push, .offset = stride});
            stride += setup.push.size;
        }
        tokens.push_back({.type = setup.last, .data = nullptr, .offset = stride});
        stride += setup.lastBytes;
        const generated::LayoutCreateInfo layout{.flags = setup.preprocess ? generated::kExplicitPreprocessBit : 0,
                                                 .shaderStages = setup.stages,
                                                 .indirectStride = stride,
                                                 .pipelineLayout = setup.layout,
                                                 .tokenCount = static_cast<uint32_t>(tokens.size()),
                                                 .pTokens = tokens.data()};
        VT_CHECK(vk_.createLayout(gpu.device(), &layout, nullptr, &layout_));

        pipelineInfo_.pipeline = setup.pipeline;
        const auto count = static_cast<uint32_t>(sequences.size_bytes() / stride);
        const void *const chain = setup.set != nullptr               ? nullptr
                                  : setup.pipeline != VK_NULL_HANDLE ? &pipelineInfo_
                                                                     : setup.shaderInfo;
        const generated::MemoryInfo memory{.pNext = chain,
                                           .indirectExecutionSet = setup.set != nullptr ? setup.set->handle() : 0,
                                           .indirectCommandsLayout = layout_,
                                           .maxSequenceCount = count,
                                           .maxDrawCount = 1};
        auto needed = vkInit<VkMemoryRequirements2>();
        vk_.memoryRequirements(gpu.device(), &memory, &needed);
        if (needed.memoryRequirements.size > 0)
            growMemory(needed.memoryRequirements);
        info_ = {.pNext = chain,
                 .shaderStages = setup.stages,
                 .indirectExecutionSet = memory.indirectExecutionSet,
                 .indirectCommandsLayout = layout_,
                 .indirectAddress = input_.address(),
                 .indirectAddressSize = sequences.size_bytes(),
                 .preprocessAddress = preprocessAddress_,
                 .preprocessSize = preprocessAddress_ != 0 ? needed.memoryRequirements.size : 0,
                 .maxSequenceCount = count,
                 .sequenceCountAddress = 0,
                 .maxDrawCount = 1};
    }
    GeneratedCommands(const GeneratedCommands &) = delete;
    GeneratedCommands &operator=(const GeneratedCommands &) = delete;
    ~GeneratedCommands()
    {
        vk_.destroyLayout(gpu_.device(), layout_, nullptr);
        vkDestroyBuffer(gpu_.device(), preprocessBuffer_, nullptr);
        vkFreeMemory(gpu_.device(), preprocessMemory_, nullptr);
    }

    // `state`: a command buffer that is being recorded, with all that is bound.
    void preprocess(VkCommandBuffer commands, VkCommandBuffer state) const { vk_.preprocess(commands, &info_, state); }
    void execute(VkCommandBuffer commands) const
    {
        vk_.execute(commands, static_cast<VkBool32>(setup_.preprocess), &info_);
    }

private:
    // A buffer whose usage needs more than 32 bits.
    void growMemory(const VkMemoryRequirements &needed)
    {
        const auto usage = vkInit<VkBufferUsageFlags2CreateInfoKHR>(
            {.usage = generated::kPreprocessBufferBit | VK_BUFFER_USAGE_SHADER_DEVICE_ADDRESS_BIT});
        auto buffer = vkInit<VkBufferCreateInfo>({.pNext = &usage, .size = needed.size});
        VT_CHECK(vkCreateBuffer(gpu_.device(), &buffer, nullptr, &preprocessBuffer_));
        VkMemoryRequirements own{};
        vkGetBufferMemoryRequirements(gpu_.device(), preprocessBuffer_, &own);
        own.memoryTypeBits &= needed.memoryTypeBits;
        preprocessMemory_ = gpu_.allocate(own);
        VT_CHECK(vkBindBufferMemory(gpu_.device(), preprocessBuffer_, preprocessMemory_, 0));
        preprocessAddress_ = gpu_.address(preprocessBuffer_);
    }

    Gpu &gpu_;
    generated::Commands vk_;
    Setup setup_;
    Buffer input_;
    generated::Handle layout_ = 0;
    generated::PipelineInfo pipelineInfo_;
    VkBuffer preprocessBuffer_ = VK_NULL_HANDLE;
    VkDeviceMemory preprocessMemory_ = VK_NULL_HANDLE;
    VkDeviceAddress preprocessAddress_ = 0;
    generated::CommandsInfo info_{};
};

} // namespace vt
