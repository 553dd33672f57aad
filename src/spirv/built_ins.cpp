#include "spirv/built_ins.h"

#include "spirv/module/opcodes.h"

namespace vellum::spirv
{
namespace
{

constexpr const char *kCustomIndex = "vellumCustomIndex";
constexpr const char *kRayFlags = "vellumApplicationFlags";

// The last of a chain of copies longer than this is not looked for: the module is malformed.
constexpr int kMaxCopies = 64;

// Words of the memory operands that begin at word i of an instruction (SPIR-V specification, 3.26).
std::uint32_t memoryOperandWords(const Module &module, Instruction in, std::uint32_t i)
{
    if (i >= in.count)
        return 0;
    const std::uint32_t mask = module.word(in, i);
    std::uint32_t words = 1;
    for (const std::uint32_t bit : {spv::MemoryAccessAlignedMask, spv::MemoryAccessMakePointerAvailableMask,
                                    spv::MemoryAccessMakePointerVisibleMask})
        words += (mask & bit) != 0 ? 1 : 0;
    return words;
}

} // namespace

Id restoreValue(Types &types, Id function, Id type, Id value, Code &out)
{
    const Id uint = types.uint32();
    if (type == uint)
        return out.value(spv::OpFunctionCall, uint, {function, value});
    const Id asUint = out.value(spv::OpBitcast, uint, {value});
    return out.value(spv::OpBitcast, type, {out.value(spv::OpFunctionCall, uint, {function, asUint})});
}

void restoreResult(Module &module, Types &types, Id function, Instruction in, Code &out)
{
    const Id type = module.word(in, 1);
    const Id result = module.word(in, 2);
    const Id driver = module.newId();
    out.out.push_back(module.with(in, 2, driver));
    const Id uint = types.uint32();
    if (type == uint) {
        out.put(spv::OpFunctionCall, {type, result, function, driver});
        return;
    }
    const Id asUint = out.value(spv::OpBitcast, uint, {driver});
    out.put(spv::OpBitcast, {type, result, out.value(spv::OpFunctionCall, uint, {function, asUint})});
}

BuiltIns::BuiltIns(Module &module, Types &types, Linker &linker, bool indexIsKnown)
    : module_(module), types_(types), linker_(linker), indexIsKnown_(indexIsKnown)
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

const char *BuiltIns::restoring(Id pointer) const
{
    // An access chain without indices is a copy too.
    const auto isCopy = [](Instruction in) {
        return in.opcode == spv::OpCopyObject ||
               ((in.opcode == spv::OpAccessChain || in.opcode == spv::OpInBoundsAccessChain) && in.count == 4);
    };
    Instruction in = module_.definition(pointer);
    for (int i = 0; i < kMaxCopies && isCopy(in); ++i) {
        pointer = module_.word(in, 3);
        in = module_.definition(pointer);
    }
    if (customIndex_.contains(pointer))
        return kCustomIndex;
    return incomingFlags_.contains(pointer) ? kRayFlags : nullptr;
}

bool BuiltIns::replace(Instruction in, Code &out)
{
    const char *function = nullptr;
    switch (in.opcode) {
    case spv::OpLoad: function = restoring(module_.word(in, 3)); break;
    case spv::OpCopyMemory:
        function = restoring(module_.word(in, 2));
        if (function)
            copy(in, function, out);
        return function != nullptr;
    case kOpHitObjectGetInstanceCustomIndexNV:
    case kOpHitObjectGetInstanceCustomIndexEXT: function = kCustomIndex; break;
    case kOpHitObjectGetRayFlagsEXT: function = kRayFlags; break;
    default: break;
    }
    if (function)
        restore(in, function, out);
    return function != nullptr;
}

void BuiltIns::restore(Instruction in, const char *function, Code &out)
{
    if (!indexIsKnown_ || function != kCustomIndex) {
        restoreResult(module_, types_, linker_.function(function), in, out);
        return;
    }
    const Id uint = types_.uint32();
    if (knownIndex_ == 0) {
        const Id pointer = types_.get(spv::OpTypePointer, {spv::StorageClassPrivate, uint});
        knownIndex_ = module_.newId();
        module_.append(Section::Globals, spv::OpVariable, {pointer, knownIndex_, spv::StorageClassPrivate});
        std::vector<std::uint32_t> name = stringWords("vellumKnownIndex");
        name.insert(name.begin(), knownIndex_);
        module_.append(Section::Names, spv::OpName, name);
    }
    const Id type = module_.word(in, 1);
    const Id result = module_.word(in, 2);
    if (type == uint)
        out.put(spv::OpLoad, {uint, result, knownIndex_});
    else
        out.put(spv::OpBitcast, {type, result, out.value(spv::OpLoad, uint, {knownIndex_})});
}

// A copy from memory to memory becomes a load, which is restored, and a store.
void BuiltIns::copy(Instruction in, const char *function, Code &out)
{
    const Id pointerType = module_.resultType(module_.definition(module_.word(in, 2)));
    const Id type = module_.word(module_.definition(pointerType), 3);
    const Id value = module_.newId();
    restore(module_.make(spv::OpLoad, {type, value, module_.word(in, 2)}), function, out);
    std::vector<std::uint32_t> store{module_.word(in, 1), value};
    // The first operands are the target's.
    for (std::uint32_t i = 3; i < 3 + memoryOperandWords(module_, in, 3); ++i)
        store.push_back(module_.word(in, i));
    out.put(spv::OpStore, std::move(store));
}

} // namespace vellum::spirv
