// SPDX-License-Identifier: Apache-2.0
#include "spirv/module/module.h"

#include "spirv/module/opcodes.h"

#include <algorithm>

namespace vellum::spirv
{
namespace
{

// Universal limit of ids (SPIR-V specification, 2.17). It also bounds what a hostile header makes us allocate.
constexpr uint32_t kMaxBound = 4'194'303;

struct Shape {
    bool hasResult = false, hasType = false;
};

// Whether the operands of an opcode begin with a result type and a result. Installed headers may be too old for some.
Shape shapeOf(uint32_t opcode)
{
    switch (opcode) {
    case kOpTypeHitObjectEXT: return {true, false};
    case kOpHitObjectGetInstanceCustomIndexNV:
    case kOpHitObjectGetInstanceCustomIndexEXT:
    case kOpHitObjectGetRayFlagsEXT: return {true, true};
    default: break;
    }
    Shape shape;
    spv::HasResultAndType(static_cast<spv::Op>(opcode), &shape.hasResult, &shape.hasType);
    return shape;
}

// The section of an opcode; nothing for those that can be in several (OpLine, OpExtInst, OpUndef...) and unknown ones.
std::optional<Section> sectionOf(uint32_t opcode)
{
    switch (opcode) {
    case spv::OpCapability: return Section::Capabilities;
    case spv::OpExtension: return Section::Extensions;
    case spv::OpExtInstImport: return Section::Imports;
    case spv::OpMemoryModel: return Section::MemoryModel;
    case spv::OpEntryPoint: return Section::EntryPoints;
    case spv::OpExecutionMode:
    case spv::OpExecutionModeId: return Section::ExecutionModes;
    case spv::OpString:
    case spv::OpSource:
    case spv::OpSourceContinued:
    case spv::OpSourceExtension: return Section::Sources;
    case spv::OpName:
    case spv::OpMemberName: return Section::Names;
    case spv::OpModuleProcessed: return Section::Processed;
    case spv::OpDecorate:
    case spv::OpDecorateId:
    case spv::OpDecorateString:
    case spv::OpMemberDecorate:
    case spv::OpMemberDecorateString:
    case spv::OpDecorationGroup:
    case spv::OpGroupDecorate:
    case spv::OpGroupMemberDecorate: return Section::Decorations;
    case spv::OpFunction: return Section::Functions;
    default: break;
    }
    // Types (also those of extensions) and constants. OpExtInst may carry debug information about other sections.
    if (opcode == spv::OpTypeForwardPointer || (shapeOf(opcode).hasResult && opcode != spv::OpExtInst))
        return Section::Globals;
    return {};
}

// Minimum number of words of the instructions that the rewriter interprets.
uint32_t minimumWords(uint32_t opcode)
{
    switch (opcode) {
    case spv::OpCapability:
    case spv::OpExtension:
    case spv::OpTypeVoid:
    case spv::OpTypeBool:
    case spv::OpLabel:
    case spv::OpBranch:
    case spv::OpReturnValue:
    case spv::OpRayQueryConfirmIntersectionKHR: return 2;
    case spv::OpExtInstImport:
    case spv::OpMemoryModel:
    case spv::OpName:
    case spv::OpExecutionMode:
    case spv::OpExecutionModeId:
    case spv::OpTypeFloat:
    case spv::OpTypeFunction:
    case spv::OpFunctionParameter:
    case spv::OpPhi:
    case spv::OpDecorate:
    case spv::OpSelectionMerge:
    case spv::OpSwitch:
    case spv::OpCopyMemory:
    case spv::OpConstantNull:
    case kOpHitObjectRecordMissEXT:
    case kOpHitObjectRecordMissMotionEXT: return 3;
    case spv::OpEntryPoint:
    case spv::OpTypeInt:
    case spv::OpTypeVector:
    case spv::OpTypePointer:
    case spv::OpConstant:
    case spv::OpVariable:
    case spv::OpLoad:
    case spv::OpAccessChain:
    case spv::OpInBoundsAccessChain:
    case spv::OpCopyObject:
    case spv::OpFunctionCall:
    case spv::OpLoopMerge:
    case spv::OpBranchConditional:
    case spv::OpRayQueryProceedKHR:
    case spv::OpRayQueryGetRayFlagsKHR:
    case spv::OpRayQueryGetIntersectionCandidateAABBOpaqueKHR:
    case kOpHitObjectTraceRayNV:
    case kOpHitObjectTraceRayMotionNV:
    case kOpHitObjectTraceRayEXT:
    case kOpHitObjectTraceRayMotionEXT:
    case kOpHitObjectTraceReorderExecuteEXT:
    case kOpHitObjectTraceMotionReorderExecuteEXT:
    case kOpHitObjectGetInstanceCustomIndexNV:
    case kOpHitObjectGetInstanceCustomIndexEXT:
    case kOpHitObjectGetRayFlagsEXT: return 4;
    case spv::OpFunction:
    case spv::OpExtInst:
    case spv::OpRayQueryGetIntersectionTypeKHR:
    case spv::OpRayQueryGetIntersectionInstanceCustomIndexKHR: return 5;
    case spv::OpRayQueryInitializeKHR: return 9;
    case spv::OpTraceRayKHR: return 12;
    case kOpTraceRayMotionNV: return 13;
    default: return 1;
    }
}

} // namespace

std::optional<Module> Module::parse(Words words, std::string &error)
{
    Module m;
    if (!isSpirv(words)) {
        error = "not a SPIR-V module of this machine's byte order";
        return {};
    }
    m.version_ = words[1];
    m.generator_ = words[2];
    m.bound_ = words[3];
    if (m.bound_ == 0 || m.bound_ > kMaxBound) {
        error = "id bound " + std::to_string(m.bound_) + " is outside SPIR-V's universal limits";
        return {};
    }
    if (words.size() > UINT32_MAX / 2) {
        error = "module is too large";
        return {};
    }
    m.definitions_.resize(m.bound_);
    m.global_.resize(m.bound_);
    m.arena_.assign(words.begin(), words.end());
    if (!m.split(words, error) || !m.checkReferences(error))
        return {};
    return m;
}

bool Module::split(Words words, std::string &error)
{
    Section current = Section::Capabilities;
    size_t known = 0; // instructions of the current section, without the last ones whose opcodes are of any section
    bool inFunction = false;
    for (size_t at = kHeaderWords; at < words.size();) {
        const Instruction in{static_cast<uint32_t>(at), static_cast<uint16_t>(words[at] >> 16),
                             static_cast<uint16_t>(words[at] & 0xffff)};
        const auto fail = [&](const char *what) {
            error = "word " + std::to_string(at) + ", opcode " + std::to_string(in.opcode) + ": " + what;
            return false;
        };
        if (in.count == 0 || in.count > words.size() - at)
            return fail("instruction runs past the end of the module");
        if (in.count < minimumWords(in.opcode))
            return fail("instruction has too few operands");
        if (!inFunction) {
            // Never backwards: whatever the order is, serialize() must not change it.
            const auto s = sectionOf(in.opcode);
            if (s && *s > current) {
                // Such instructions may belong to the next section. What append() adds to this one comes before them.
                const Section next = std::min(*s, Section::Globals);
                auto &before = section(current);
                if (next != current) {
                    const auto others = before.begin() + static_cast<ptrdiff_t>(known);
                    section(next).assign(others, before.end());
                    before.erase(others, before.end());
                }
                current = *s;
            }
            known = s ? section(current).size() + 1 : known;
        }
        if (in.opcode == spv::OpFunction) {
            if (inFunction)
                return fail("function inside a function");
            inFunction = true;
        } else if (in.opcode == spv::OpFunctionEnd) {
            if (!inFunction)
                return fail("end of a function that did not begin");
            inFunction = false;
        } else if (current == Section::Functions && !inFunction && in.opcode == spv::OpLabel) {
            return fail("block outside of a function");
        }
        if (!define(in, current != Section::Functions, error))
            return fail(error.c_str());
        section(current).push_back(in);
        at += in.count;
    }
    if (inFunction)
        error = "module ends inside a function";
    else if (section(Section::MemoryModel).empty() || section(Section::Functions).empty())
        error = "module ends before its functions";
    return error.empty();
}

bool Module::define(Instruction in, bool global, std::string &error)
{
    const Id id = result(in);
    if (id == 0) {
        if (shapeOf(in.opcode).hasResult)
            error = "instruction lacks its result id";
        return error.empty();
    }
    if (id >= bound_)
        error = "result id is not below the bound";
    else if (definitions_[id].count != 0)
        error = "result id is already defined";
    if (!error.empty())
        return false;
    definitions_[id] = in;
    global_[id] = global;
    return true;
}

// Detects a module that is cut off between two functions, which is well formed otherwise.
bool Module::checkReferences(std::string &error) const
{
    for (const Instruction in : section(Section::EntryPoints))
        if (in.opcode == spv::OpEntryPoint && definition(word(in, 2)).opcode != spv::OpFunction)
            error = "entry point without its function";
    for (const Instruction in : section(Section::Functions))
        if (in.opcode == spv::OpFunctionCall && definition(word(in, 3)).opcode != spv::OpFunction)
            error = "call of a function that does not exist";
    return error.empty();
}

std::vector<uint32_t> Module::serialize() const
{
    std::vector<uint32_t> out{spv::MagicNumber, version_, generator_, bound_, 0};
    out.reserve(arena_.size() + kHeaderWords);
    for (const auto &s : sections_)
        for (const Instruction in : s) {
            const Words w = words(in);
            out.insert(out.end(), w.begin(), w.end());
        }
    return out;
}

std::string Module::string(Instruction in, uint32_t i) const
{
    return i < in.count ? textOf(words(in).subspan(i)) : "";
}

Id Module::result(Instruction in) const
{
    const Shape shape = shapeOf(in.opcode);
    return shape.hasResult ? word(in, shape.hasType ? 2 : 1) : 0;
}

Id Module::resultType(Instruction in) const
{
    return shapeOf(in.opcode).hasType ? word(in, 1) : 0;
}

Instruction Module::make(uint32_t opcode, Words operands)
{
    const Instruction in{static_cast<uint32_t>(arena_.size()), static_cast<uint16_t>(operands.size() + 1),
                         static_cast<uint16_t>(opcode)};
    arena_.push_back(uint32_t{in.count} << 16 | in.opcode);
    arena_.insert(arena_.end(), operands.begin(), operands.end());
    return in;
}

void Module::append(Section s, uint32_t opcode, Words operands)
{
    const Instruction in = make(opcode, operands);
    section(s).push_back(in);
    const Id id = result(in);
    if (id == 0)
        return;
    if (id >= definitions_.size()) {
        definitions_.resize(id + 1);
        global_.resize(id + 1);
    }
    definitions_[id] = in;
    global_[id] = true;
}

bool Module::addToInterfaces(const std::vector<Id> &variables)
{
    if (version_ < kVersion14 || variables.empty())
        return true;
    for (Instruction &in : section(Section::EntryPoints)) {
        if (in.opcode != spv::OpEntryPoint)
            continue;
        const Words before = words(in);
        std::vector<uint32_t> operands(before.begin() + 1, before.end());
        operands.insert(operands.end(), variables.begin(), variables.end());
        if (operands.size() + 1 > kMaxInstructionWords)
            return false;
        in = make(spv::OpEntryPoint, operands);
    }
    return true;
}

void Module::set(Instruction in, uint32_t i, uint32_t value)
{
    if (i != 0 && i < in.count)
        arena_[in.first + i] = value;
}

Instruction Module::with(Instruction in, uint32_t i, uint32_t value)
{
    if (i == 0 || i >= in.count)
        return in;
    const Words w = words(in);
    std::vector<uint32_t> copy(w.begin() + 1, w.end());
    copy[i - 1] = value;
    return make(in.opcode, copy);
}

bool Module::hasCapability(uint32_t capability) const
{
    return std::ranges::any_of(section(Section::Capabilities), [&](Instruction in) {
        return in.opcode == spv::OpCapability && word(in, 1) == capability;
    });
}

std::vector<uint32_t> stringWords(const char *text)
{
    std::vector<uint32_t> out(1);
    uint32_t shift = 0;
    for (; *text != 0; ++text) {
        out.back() |= uint32_t{static_cast<unsigned char>(*text)} << shift;
        shift += 8;
        if (shift == 32) {
            out.push_back(0);
            shift = 0;
        }
    }
    return out;
}

} // namespace vellum::spirv
