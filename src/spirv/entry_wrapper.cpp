// SPDX-License-Identifier: Apache-2.0
#include "spirv/entry_wrapper.h"

#include <algorithm>

#include "core/opacity.h"
#include "spirv/module/code.h"
#include "spirv/module/numbers.h"
#include "spirv/module/uses.h"
#include "spirv/payload_types.h"

namespace vellum::spirv
{
namespace
{

// Bounds for malformed modules: hit attributes have a few dozen bytes.
constexpr size_t kMaxTypes = 256;
constexpr size_t kMaxEntryOperands = 65000;

} // namespace

bool isEntryPoint(const Module &module, Instruction in, const PipelineStage &stage)
{
    return in.opcode == spv::OpEntryPoint && module.word(in, 1) == stage.executionModel &&
           module.string(in, 3) == stage.entryPoint;
}

bool EntryWrapper::selectEntryPoint(const PipelineStage &stage)
{
    auto &entries = module_.section(Section::EntryPoints);
    const auto chosen = std::ranges::find_if(entries, [&](Instruction in) { return isEntryPoint(module_, in, stage); });
    if (chosen == entries.end()) {
        error_ = "it has no entry point \"" + std::string(stage.entryPoint) + "\" of the stage";
        return false;
    }
    const Words words = module_.words(*chosen);
    entry_.assign(words.begin() + 1, words.end());
    if (entry_.size() > kMaxEntryOperands) {
        error_ = "its entry point has too long an interface";
        return false;
    }
    interface_ = std::min(2 + stringWords(std::string(stage.entryPoint).c_str()).size(), entry_.size());
    application_ = module_.word(*chosen, 2);
    if (stage.hidden.inPayload())
        declaredPayload_ = incomingPayload(module_, *chosen);
    // The section may have unknown instructions, too.
    std::erase_if(entries, [&, first = chosen->first](Instruction in) {
        return in.opcode == spv::OpEntryPoint && in.first != first;
    });
    std::erase_if(module_.section(Section::ExecutionModes), [&](Instruction in) {
        return (in.opcode == spv::OpExecutionMode || in.opcode == spv::OpExecutionModeId) &&
               module_.word(in, 1) != application_;
    });
    return true;
}

bool EntryWrapper::wrap(const PipelineStage &stage)
{
    if (!selectEntryPoint(stage))
        return false;
    hidden_ = stage.hidden;
    receivesPayload_ = receivesPayload(stage.executionModel);
    Prologue prologue = stage.prologue;
    // If CullNoOpaque may be in the payload, which only the any-hit shader of the box can read, that shader decides.
    if (prologue == Prologue::BoxCulling && hidden_.inPayload() && (hidden_.constant & shared::kRayCullNoOpaque) == 0)
        prologue = Prologue::None;
    if (prologue == Prologue::None && prefix_.keptFlagsIfRequested() == 0)
        return true;
    const Id wrapper = module_.newId();
    for (Instruction &in : module_.section(Section::ExecutionModes)) {
        if (in.opcode == spv::OpExecutionMode || in.opcode == spv::OpExecutionModeId)
            in = module_.with(in, 1, wrapper);
    }
    std::vector<uint32_t> name = stringWords("vellumEntry");
    name.insert(name.begin(), wrapper);
    module_.append(Section::Names, spv::OpName, name);

    const Id none = types_.none();
    code_.put(spv::OpFunction, {none, wrapper, spv::FunctionControlMaskNone, types_.function(none, {})});
    code_.put(spv::OpLabel, {module_.newId()});
    keepFlags();
    switch (prologue) {
    case Prologue::None: code_.value(spv::OpFunctionCall, none, {application_}); break;
    case Prologue::TriangleHits: decideTriangle(); break;
    case Prologue::BoxHits: decideBox(); break;
    case Prologue::EitherHits: decideEither(); break;
    default: cullBox(); break;
    }
    code_.put(spv::OpReturn, {});
    code_.put(spv::OpFunctionEnd, {});
    auto &functions = module_.section(Section::Functions);
    functions.insert(functions.end(), code_.out.begin(), code_.out.end());
    entry_[1] = wrapper;
    std::ranges::replace_if(
        module_.section(Section::EntryPoints), [](Instruction in) { return in.opcode == spv::OpEntryPoint; },
        module_.make(spv::OpEntryPoint, entry_));
    return error_.empty();
}

// Ignored hits are rejected, and opaque ones accepted without the application's shader. Others run it.
void EntryWrapper::decideTriangle()
{
    const Id barycentrics = readBarycentrics();
    const Id hit = resolveTriangle(barycentrics, applicationFlags());
    const Id boolean = types_.boolean();
    ignoreIf(code_.value(spv::OpIEqual, boolean, {hit, types_.uintConstant(shared::kHitIgnored)}));
    callIf(code_.value(spv::OpIEqual, boolean, {hit, types_.uintConstant(shared::kHitNonOpaque)}));
}

Id EntryWrapper::resolveTriangle(Id barycentrics, Id flags)
{
    const Id uint = types_.uint32();
    const Id slot = readBuiltIn(spv::BuiltInInstanceCustomIndexKHR);
    const Id geometry = readBuiltIn(spv::BuiltInRayGeometryIndexKHR);
    const Id primitive = readBuiltIn(spv::BuiltInPrimitiveId);
    const Id record = types_.get(spv::OpTypeVector, {uint, 4});
    const Id instance = code_.value(spv::OpFunctionCall, record, {linker_.function("vellumInstance"), slot});
    const Id hit = code_.value(spv::OpFunctionCall, uint,
                               {linker_.function("vellumResolve"), instance, geometry, primitive, barycentrics, flags});
    if (knownIndex_ != 0) {
        const Id index = code_.value(spv::OpFunctionCall, uint, {linker_.function("vellumIndexOf"), instance});
        code_.put(spv::OpStore, {knownIndex_, index});
        if (module_.version() >= kVersion14) // before, an interface holds inputs and outputs only
            entry_.push_back(knownIndex_);
    }
    return hit;
}

// The driver runs an any-hit shader for boxes that are not opaque. The hidden flag Opaque makes them opaque.
void EntryWrapper::decideBox()
{
    const Id flags = applicationFlags();
    ignoreIf(hasBits(types_, flags, shared::kRayCullNoOpaque, code_));
    callIf(code_.value(spv::OpLogicalNot, types_.boolean(), {hasBits(types_, flags, shared::kRayOpaque, code_)}));
}

// As above, by the kind of the hit: those of triangles are the driver's, and above what intersection shaders may report
// (VUID-RuntimeSpirv-OpReportIntersectionKHR-06998).
void EntryWrapper::decideEither()
{
    constexpr uint32_t kMostReportedKind = 127;
    const Id barycentrics = readBarycentrics();
    if (!error_.empty()) { // only boxes have such attributes
        error_.clear();
        decideBox();
        return;
    }
    const Id uint = types_.uint32();
    const Id boolean = types_.boolean();
    const Id either = module_.newId(), triangle = module_.newId(), decided = module_.newId();
    code_.put(spv::OpBranch, {either});
    code_.put(spv::OpLabel, {either});
    const Id flags = applicationFlags();
    const Id box = code_.value(
        spv::OpSelect, uint,
        {hasBits(types_, flags, shared::kRayCullNoOpaque, code_), types_.uintConstant(shared::kHitIgnored),
         code_.value(spv::OpSelect, uint,
                     {hasBits(types_, flags, shared::kRayOpaque, code_), types_.uintConstant(shared::kHitOpaque),
                      types_.uintConstant(shared::kHitNonOpaque)})});
    const Id isTriangle = code_.value(spv::OpUGreaterThan, boolean,
                                      {readBuiltIn(spv::BuiltInHitKindKHR), types_.uintConstant(kMostReportedKind)});
    code_.put(spv::OpSelectionMerge, {decided, spv::SelectionControlMaskNone});
    code_.put(spv::OpBranchConditional, {isTriangle, triangle, decided});
    code_.put(spv::OpLabel, {triangle});
    const Id resolved = resolveTriangle(barycentrics, flags);
    code_.put(spv::OpBranch, {decided});
    code_.put(spv::OpLabel, {decided});
    const Id hit = code_.value(spv::OpPhi, uint, {box, either, resolved, triangle});
    ignoreIf(code_.value(spv::OpIEqual, boolean, {hit, types_.uintConstant(shared::kHitIgnored)}));
    callIf(code_.value(spv::OpIEqual, boolean, {hit, types_.uintConstant(shared::kHitNonOpaque)}));
}

// A box that is culled does not run its intersection shader (Vulkan, "Ray Opacity Culling").
void EntryWrapper::cullBox()
{
    const Id slot = readBuiltIn(spv::BuiltInInstanceCustomIndexKHR);
    const Id geometry = readBuiltIn(spv::BuiltInRayGeometryIndexKHR);
    const Id culled = code_.value(spv::OpFunctionCall, types_.boolean(),
                                  {linker_.function("vellumCullsBox"), slot, geometry, applicationFlags()});
    callIf(code_.value(spv::OpLogicalNot, types_.boolean(), {culled}));
}

void EntryWrapper::ignoreIf(Id condition)
{
    const Id ignore = module_.newId(), rest = module_.newId();
    code_.put(spv::OpSelectionMerge, {rest, spv::SelectionControlMaskNone});
    code_.put(spv::OpBranchConditional, {condition, ignore, rest});
    code_.put(spv::OpLabel, {ignore});
    code_.put(spv::OpIgnoreIntersectionKHR, {});
    code_.put(spv::OpLabel, {rest});
}

void EntryWrapper::callIf(Id condition)
{
    const Id call = module_.newId(), end = module_.newId();
    code_.put(spv::OpSelectionMerge, {end, spv::SelectionControlMaskNone});
    code_.put(spv::OpBranchConditional, {condition, call, end});
    code_.put(spv::OpLabel, {call});
    code_.value(spv::OpFunctionCall, types_.none(), {application_});
    code_.put(spv::OpBranch, {end});
    code_.put(spv::OpLabel, {end});
}

Id EntryWrapper::applicationFlags()
{
    const Id uint = types_.uint32();
    const Id flags = readBuiltIn(spv::BuiltInIncomingRayFlagsKHR);
    if (hidden_.inPayload() && receivesPayload_)
        return code_.value(spv::OpBitwiseOr, uint, {flags, code_.value(spv::OpLoad, uint, {incomingPrefix()})});
    if (hidden_.constant == 0)
        return flags;
    return code_.value(spv::OpBitwiseOr, uint, {flags, types_.uintConstant(hidden_.constant)});
}

Id EntryWrapper::incomingPrefix()
{
    if (incomingPrefix_ != 0)
        return incomingPrefix_;
    if (declaredPayload_ != 0)
        return incomingPrefix_ = prefix_.pointer(declaredPayload_, code_);
    const Id variable = makeInput(spv::StorageClassIncomingRayPayloadKHR, prefix_.ownPayload(hidden_.payload));
    const Id pointer = types_.get(spv::OpTypePointer, {spv::StorageClassIncomingRayPayloadKHR, types_.uint32()});
    incomingPrefix_ = code_.value(spv::OpAccessChain, pointer, {variable, types_.uintConstant(0)});
    return incomingPrefix_;
}

// Stores the hidden flags for code of the application that reads them later.
void EntryWrapper::keepFlags()
{
    const Id kept = prefix_.keptFlagsIfRequested();
    if (kept == 0)
        return;
    if (module_.version() >= kVersion14)
        entry_.push_back(kept);
    code_.put(spv::OpStore, {kept, code_.value(spv::OpLoad, types_.uint32(), {incomingPrefix()})});
}

bool EntryWrapper::inInterface(Id variable) const
{
    return std::find(entry_.begin() + static_cast<ptrdiff_t>(interface_), entry_.end(), variable) != entry_.end();
}

// A module may declare a built-in twice, but an interface may not (VUID-StandaloneSpirv-OpEntryPoint-09658), so the
// application's variable is used if there is one.
Id EntryWrapper::readBuiltIn(uint32_t builtIn)
{
    const Id uint = types_.uint32();
    Id variable = 0;
    for (const Instruction in : module_.section(Section::Decorations)) {
        if (in.opcode == spv::OpDecorate && module_.word(in, 2) == spv::DecorationBuiltIn &&
            module_.word(in, 3) == builtIn && inInterface(module_.word(in, 1)))
            variable = module_.word(in, 1);
    }
    if (variable == 0) {
        variable = makeInput(spv::StorageClassInput, uint);
        module_.append(Section::Decorations, spv::OpDecorate, {variable, spv::DecorationBuiltIn, builtIn});
    }
    const Id pointer = module_.resultType(module_.definition(variable));
    const Id type = module_.word(module_.definition(pointer), 3);
    const Id value = code_.value(spv::OpLoad, type, {variable});
    return toUint(types_, type, value, code_);
}

Id EntryWrapper::makeInput(uint32_t storageClass, Id type)
{
    const Id pointer = types_.get(spv::OpTypePointer, {storageClass, type});
    const Id variable = module_.newId();
    module_.append(Section::Globals, spv::OpVariable, {pointer, variable, storageClass});
    // Before SPIR-V 1.4 an interface holds inputs and outputs only.
    if (storageClass == spv::StorageClassInput || module_.version() >= kVersion14)
        entry_.push_back(variable);
    return variable;
}

// An interface has at most one variable of this class (VUID-StandaloneSpirv-HitAttributeKHR-04702), and for triangles
// it begins with the barycentrics, whatever its type.
Id EntryWrapper::readBarycentrics()
{
    const Id vec2 = types_.float32x2();
    Id variable = 0;
    for (const Instruction in : module_.section(Section::Globals)) {
        if (in.opcode == spv::OpVariable && module_.word(in, 3) == spv::StorageClassHitAttributeKHR &&
            (module_.version() < kVersion14
                 ? usesPointer(module_, CallGraph(module_).reachedFrom({application_}), module_.result(in))
                 : inInterface(module_.result(in))))
            variable = module_.result(in);
    }
    if (variable == 0)
        return code_.value(spv::OpLoad, vec2, {makeInput(spv::StorageClassHitAttributeKHR, vec2)});
    const Id pointer = module_.resultType(module_.definition(variable));
    const Id type = module_.word(module_.definition(pointer), 3);
    if (type == vec2)
        return code_.value(spv::OpLoad, vec2, {variable});

    std::vector<uint32_t> path;
    std::vector<Scalar> found;
    size_t budget = kMaxTypes;
    if (!findScalars(type, path, found, budget) || found.size() < 2) {
        error_ = "its hit attributes do not begin with two 32-bit numbers";
        return 0;
    }
    const Id float32 = types_.float32();
    std::vector<uint32_t> floats;
    for (const Scalar &scalar : {found[0], found[1]}) {
        std::vector<uint32_t> chain{variable};
        for (const uint32_t index : scalar.path)
            chain.push_back(types_.uintConstant(index));
        const Id scalarPointer = types_.get(spv::OpTypePointer, {spv::StorageClassHitAttributeKHR, scalar.type});
        const Id value = code_.value(spv::OpLoad, scalar.type, {code_.value(spv::OpAccessChain, scalarPointer, chain)});
        floats.push_back(scalar.type == float32 ? value : code_.value(spv::OpBitcast, float32, {value}));
    }
    return code_.value(spv::OpCompositeConstruct, vec2, floats);
}

// The length of an array; if it is a specialization constant, its default.
uint32_t EntryWrapper::arrayLength(Instruction array) const
{
    const Instruction length = module_.definition(module_.word(array, 3));
    if (length.opcode == spv::OpSpecConstant)
        return module_.word(length, 3);
    return types_.valueOf(module_.word(array, 3)).value_or(0);
}

// Appends the first two scalars of a type to `found`; false if one does not have 32 bits.
bool EntryWrapper::findScalars(Id type, std::vector<uint32_t> &path, std::vector<Scalar> &found, size_t &budget) const
{
    --budget;
    const Instruction in = module_.definition(type);
    uint32_t members = 0;
    switch (in.opcode) {
    case spv::OpTypeFloat:
    case spv::OpTypeInt: found.push_back({type, path}); return module_.word(in, 2) == 32;
    case spv::OpTypeVector:
    case spv::OpTypeMatrix: members = module_.word(in, 3); break;
    case spv::OpTypeArray: members = arrayLength(in); break;
    case spv::OpTypeStruct: members = in.count - 2u; break;
    default: return false;
    }
    for (uint32_t i = 0; i < members && found.size() < 2; ++i) {
        if (budget == 0)
            return false;
        path.push_back(i);
        const Id member = module_.word(in, in.opcode == spv::OpTypeStruct ? 2 + i : 2);
        const bool good = findScalars(member, path, found, budget);
        path.pop_back();
        if (!good)
            return false;
    }
    return true;
}

} // namespace vellum::spirv
