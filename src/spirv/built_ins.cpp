// SPDX-License-Identifier: Apache-2.0
#include "spirv/built_ins.h"

#include <algorithm>

#include "spirv/module/code.h"
#include "spirv/module/numbers.h"
#include "spirv/module/uses.h"

namespace vellum::spirv
{
namespace
{

// Words of the memory operands that begin at word i of an instruction (SPIR-V specification, 3.26).
uint32_t memoryOperandWords(const Module &module, Instruction in, uint32_t i)
{
    if (i >= in.count)
        return 0;
    const uint32_t mask = module.word(in, i);
    uint32_t words = 1;
    for (const uint32_t bit : {spv::MemoryAccessAlignedMask, spv::MemoryAccessMakePointerAvailableMask,
                               spv::MemoryAccessMakePointerVisibleMask})
        words += (mask & bit) != 0 ? 1 : 0;
    return words;
}

} // namespace

void loadUint(const Module &module, Types &types, Id pointer, Instruction in, Code &out)
{
    putUint(types, module.word(in, 1), module.word(in, 2), spv::OpLoad, {pointer}, out);
}

void restoreResult(Module &module, Types &types, Id function, Instruction in, Code &out)
{
    const Id type = module.word(in, 1);
    const Id driver = module.newId();
    out.out.push_back(module.with(in, 2, driver));
    const Id value = toUint(types, type, driver, out);
    putUint(types, type, module.word(in, 2), spv::OpFunctionCall, {function, value}, out);
}

BuiltIns::BuiltIns(Module &module, Types &types, Linker &linker, PayloadPrefix &prefix, SideVariables &hitObjects,
                   const std::optional<PipelineStage> &stage)
    : module_(module), types_(types), linker_(linker), prefix_(prefix), hitObjects_(hitObjects), stage_(stage)
{
    for (const Instruction in : module.section(Section::Decorations)) {
        if (in.opcode != spv::OpDecorate || module.word(in, 2) != spv::DecorationBuiltIn)
            continue;
        if (module.word(in, 3) == spv::BuiltInInstanceCustomIndexKHR)
            customIndex_.insert(module.word(in, 1));
        else if (module.word(in, 3) == spv::BuiltInIncomingRayFlagsKHR)
            incomingFlags_.insert(module.word(in, 1));
    }
}

bool BuiltIns::lacksHiddenFlags() const
{
    if (!stage_ || stage_->executionModel != spv::ExecutionModelIntersectionKHR || !stage_->hidden.inPayload())
        return false;
    return std::ranges::any_of(module_.section(Section::EntryPoints), [&](Instruction in) {
        const Words words = module_.words(in);
        return in.opcode == spv::OpEntryPoint && module_.word(in, 1) == stage_->executionModel &&
               std::any_of(words.begin() + 3, words.end(), [&](Id id) { return incomingFlags_.contains(id); });
    });
}

BuiltIns::Restored BuiltIns::pointedTo(Id pointer) const
{
    pointer = copiedFrom(module_, pointer);
    if (customIndex_.contains(pointer))
        return Restored::CustomIndex;
    return incomingFlags_.contains(pointer) ? Restored::RayFlags : Restored::Nothing;
}

void BuiltIns::readKnownIndex(Instruction in, Code &out)
{
    if (knownIndex_ == 0) {
        knownIndex_ = addPrivateVariable(module_, types_, types_.uint32());
        std::vector<uint32_t> name = stringWords("vellumKnownIndex");
        name.insert(name.begin(), knownIndex_);
        module_.append(Section::Names, spv::OpName, name);
    }
    loadUint(module_, types_, knownIndex_, in, out);
}

bool BuiltIns::restore(Instruction in, Restored what, Code &out)
{
    if (what == Restored::CustomIndex && stage_ && stage_->prologue == Prologue::TriangleHits) {
        readKnownIndex(in, out);
        return true;
    }
    if (what == Restored::CustomIndex) {
        restoreResult(module_, types_, linker_.function("vellumCustomIndex"), in, out);
        return true;
    }
    if (!stage_)
        return false;
    Id bits = 0;
    if (stage_->hidden.inPayload() && receivesPayload(stage_->executionModel))
        bits = out.value(spv::OpLoad, types_.uint32(), {prefix_.keptFlags()});
    else if (stage_->hidden.constant != 0)
        bits = types_.uintConstant(stage_->hidden.constant);
    else
        return false;
    addBits(in, bits, out);
    return true;
}

void BuiltIns::addBits(Instruction in, Id bits, Code &out)
{
    const Id driver = module_.newId();
    out.out.push_back(module_.with(in, 2, driver));
    out.put(spv::OpBitwiseOr, {module_.word(in, 1), module_.word(in, 2), driver, bits}); // of either signedness
}

bool BuiltIns::restoreHitObjectFlags(Instruction in, Code &out)
{
    const Id kept = hitObjects_.pointer(module_.word(in, 3), out);
    if (kept == 0)
        return false; // TraceRays fails, unless no ray is traced for it
    addBits(in, out.value(spv::OpLoad, types_.uint32(), {kept}), out);
    return true;
}

bool BuiltIns::replace(Instruction in, Code &out)
{
    Restored what = Restored::Nothing;
    switch (in.opcode) {
    case spv::OpLoad: what = pointedTo(module_.word(in, 3)); break;
    case spv::OpCopyMemory:
        what = pointedTo(module_.word(in, 2));
        return what != Restored::Nothing && copy(in, what, out);
    case spv::OpHitObjectGetInstanceCustomIndexNV:
    case spv::OpHitObjectGetInstanceCustomIndexEXT: what = Restored::CustomIndex; break;
    case spv::OpHitObjectGetRayFlagsEXT:
        if (hitObjects_.inUse())
            return restoreHitObjectFlags(in, out);
        what = Restored::RayFlags;
        break;
    default: break;
    }
    return what != Restored::Nothing && restore(in, what, out);
}

// A copy from memory to memory becomes a load, which is restored, and a store.
bool BuiltIns::copy(Instruction in, Restored what, Code &out)
{
    const Id pointerType = module_.resultType(module_.definition(module_.word(in, 2)));
    const Id type = module_.word(module_.definition(pointerType), 3);
    const Id value = module_.newId();
    if (!restore(module_.make(spv::OpLoad, {type, value, module_.word(in, 2)}), what, out))
        return false;
    std::vector<uint32_t> store{module_.word(in, 1), value};
    // The first memory operands are those of the target.
    for (uint32_t i = 3; i < 3 + memoryOperandWords(module_, in, 3); ++i)
        store.push_back(module_.word(in, i));
    out.put(spv::OpStore, std::move(store));
    return true;
}

} // namespace vellum::spirv
