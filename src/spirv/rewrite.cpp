#include "spirv/rewrite.h"

#include "spirv/opcodes.h"
#include "spirv/ray_query.h"

#include "shaders/lookup.h"

namespace vellum::spirv
{
namespace
{

// Removes what declares the use of opacity micromaps: the driver knows none of it. Returns whether there was anything.
bool removeDeclarations(Module &module)
{
    std::size_t removed = 0;
    removed += std::erase_if(module.section(Section::Capabilities), [&](Instruction in) {
        const std::uint32_t capability = module.word(in, 1);
        return in.opcode == spv::OpCapability &&
               (capability == kCapabilityOpacityMicromap || capability == kCapabilityOpacityMicromapExecutionMode);
    });
    removed += std::erase_if(module.section(Section::Extensions), [&](Instruction in) {
        const std::string name = module.string(in, 1);
        return in.opcode == spv::OpExtension &&
               (name == "SPV_EXT_opacity_micromap" || name == "SPV_KHR_opacity_micromap");
    });
    removed += std::erase_if(module.section(Section::ExecutionModes), [&](Instruction in) {
        return (in.opcode == spv::OpExecutionMode || in.opcode == spv::OpExecutionModeId) &&
               module.word(in, 2) == kExecutionModeOpacityMicromapId;
    });
    return removed != 0;
}

RewriteResult failed(std::string error)
{
    return {.status = RewriteResult::Status::Failed, .words = {}, .error = std::move(error)};
}

} // namespace

bool tracesRays(std::span<const std::uint32_t> words)
{
    if (words.size() < 5 || words[0] != spv::MagicNumber)
        return false;
    for (std::size_t at = 5; at + 1 < words.size();) {
        const std::uint32_t opcode = words[at] & 0xffff;
        if (opcode == spv::OpMemoryModel || opcode == spv::OpFunction)
            return false;
        if (opcode == spv::OpCapability) {
            switch (words[at + 1]) {
            // The first two are declared implicitly by the others.
            case spv::CapabilityRayQueryKHR:
            case spv::CapabilityRayTracingKHR:
            case kCapabilityRayTraversalPrimitiveCulling:
            case kCapabilityRayQueryPositionFetch:
            case kCapabilityOpacityMicromap:
            case kCapabilityOpacityMicromapExecutionMode: return true;
            default: break;
            }
        }
        const std::uint32_t count = words[at] >> 16;
        if (count == 0)
            return false;
        at += count;
    }
    return false;
}

RewriteResult rewrite(std::span<const std::uint32_t> words, const RewriteOptions &options)
{
    if (!tracesRays(words))
        return {};
    std::string error;
    std::optional<Module> module = Module::parse(words, error);
    if (!module)
        return failed(error);

    bool changed = removeDeclarations(*module);
    Types types(*module);
    Linker linker(*module, types, lookup,
                  {{0, static_cast<std::uint32_t>(options.rootAddress)},
                   {1, static_cast<std::uint32_t>(options.rootAddress >> 32)}});
    RayQueries queries(*module, types, linker, options.carriesFlagBits);
    changed = queries.rewrite() || changed;
    if (!queries.error().empty())
        return failed(queries.error());
    if (!linker.finish())
        return failed(linker.error());
    if (!changed)
        return {};
    return {.status = RewriteResult::Status::Rewritten, .words = module->serialize(), .error = {}};
}

} // namespace vellum::spirv
