// SPDX-License-Identifier: Apache-2.0
#include "spirv/module/module.h"

#include "spirv/module/numbers.h"

#include <algorithm>
#include <iterator>
#include <map>

namespace vellum::spirv
{
namespace
{

// Instructions with a result and no type, and with both, in the registry's grammar: the first and last opcode of each
// range (tests/structure/check_spirv_numbers.py).
struct Opcodes {
    uint16_t first, last;
};
constexpr Opcodes kResults[] = {
    {7, 7},       {11, 11},     {19, 38},     {73, 73},     {248, 248},   {322, 322},   {327, 327},
    {4163, 4163}, {4190, 4190}, {4417, 4417}, {4456, 4456}, {4472, 4472}, {5076, 5076}, {5103, 5104},
    {5115, 5115}, {5281, 5281}, {5288, 5288}, {5313, 5313}, {5341, 5341}, {5358, 5358}, {5370, 5371},
    {5609, 5609}, {5700, 5712}, {5911, 5913}, {6086, 6086}, {6199, 6199},
};
constexpr Opcodes kTypedResults[] = {
    {1, 1},       {12, 12},     {41, 46},     {48, 52},     {54, 55},     {57, 57},     {59, 61},     {65, 70},
    {77, 84},     {86, 98},     {100, 107},   {109, 124},   {126, 152},   {154, 191},   {194, 205},   {207, 215},
    {227, 227},   {229, 242},   {245, 245},   {259, 259},   {261, 271},   {274, 279},   {282, 286},   {291, 296},
    {299, 300},   {303, 316},   {318, 318},   {320, 321},   {323, 326},   {328, 328},   {333, 366},   {400, 403},
    {4160, 4162}, {4164, 4164}, {4166, 4166}, {4181, 4181}, {4183, 4184}, {4195, 4195}, {4418, 4425}, {4427, 4434},
    {4447, 4447}, {4450, 4455}, {4457, 4457}, {4459, 4463}, {4477, 4477}, {4479, 4483}, {4497, 4497}, {4500, 4503},
    {4505, 4505}, {4540, 4542}, {4545, 4545}, {5000, 5007}, {5011, 5012}, {5056, 5056}, {5074, 5074}, {5078, 5078},
    {5090, 5090}, {5101, 5101}, {5110, 5111}, {5119, 5119}, {5126, 5126}, {5129, 5129}, {5147, 5148}, {5158, 5159},
    {5252, 5255}, {5257, 5258}, {5265, 5265}, {5267, 5278}, {5283, 5283}, {5289, 5289}, {5292, 5293}, {5296, 5296},
    {5300, 5302}, {5307, 5308}, {5320, 5320}, {5322, 5334}, {5340, 5340}, {5345, 5352}, {5359, 5359}, {5361, 5363},
    {5366, 5367}, {5369, 5369}, {5372, 5379}, {5381, 5382}, {5384, 5384}, {5390, 5396}, {5398, 5398}, {5427, 5439},
    {5571, 5575}, {5577, 5577}, {5580, 5580}, {5585, 5598}, {5600, 5601}, {5610, 5611}, {5614, 5615}, {5631, 5631},
    {5699, 5699}, {5713, 5816}, {5818, 5819}, {5840, 5843}, {5846, 5882}, {5923, 5934}, {5938, 5938}, {5949, 5949},
    {6016, 6032}, {6035, 6035}, {6116, 6117}, {6145, 6145}, {6163, 6163}, {6165, 6165}, {6237, 6237}, {6242, 6242},
    {6244, 6244}, {6251, 6254}, {6258, 6258}, {6401, 6408}, {6426, 6426}, {6428, 6428}, {6529, 6531}, {6916, 6918},
};
constexpr uint32_t kOpcodes = std::end(kTypedResults)[-1].last + 1u;
static_assert(std::end(kResults)[-1].last < kOpcodes);

constexpr auto kShapes = [] {
    std::array<ResultShape, kOpcodes> shapes{};
    for (const Opcodes &range : kResults)
        for (uint32_t opcode = range.first; opcode <= range.last; ++opcode)
            shapes[opcode] = {.hasResult = true};
    for (const Opcodes &range : kTypedResults)
        for (uint32_t opcode = range.first; opcode <= range.last; ++opcode)
            shapes[opcode] = {.hasResult = true, .hasType = true};
    return shapes;
}();

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
    if (opcode == spv::OpTypeForwardPointer || (resultShape(opcode).hasResult && opcode != spv::OpExtInst))
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
    case spv::OpHitObjectRecordMissEXT:
    case spv::OpHitObjectRecordMissMotionEXT: return 3;
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
    case spv::OpHitObjectTraceRayNV:
    case spv::OpHitObjectTraceRayMotionNV:
    case spv::OpHitObjectTraceRayEXT:
    case spv::OpHitObjectTraceRayMotionEXT:
    case spv::OpHitObjectTraceReorderExecuteEXT:
    case spv::OpHitObjectTraceMotionReorderExecuteEXT:
    case spv::OpHitObjectGetInstanceCustomIndexNV:
    case spv::OpHitObjectGetInstanceCustomIndexEXT:
    case spv::OpHitObjectGetRayFlagsEXT: return 4;
    case spv::OpFunction:
    case spv::OpExtInst:
    case spv::OpRayQueryGetIntersectionTypeKHR:
    case spv::OpRayQueryGetIntersectionInstanceCustomIndexKHR: return 5;
    case spv::OpRayQueryInitializeKHR: return 9;
    case spv::OpTraceRayKHR: return 12;
    case spv::OpTraceRayMotionNV: return 13;
    default: return 1;
    }
}

bool isDecoration(uint32_t opcode)
{
    return opcode == spv::OpDecorate || opcode == spv::OpDecorateId || opcode == spv::OpDecorateString;
}

// The same decoration of a structure's member.
uint32_t memberDecoration(uint32_t opcode)
{
    return opcode == spv::OpDecorateString ? spv::OpMemberDecorateString : spv::OpMemberDecorate;
}

} // namespace

ResultShape resultShape(uint32_t opcode)
{
    return opcode < kOpcodes ? kShapes[opcode] : ResultShape{};
}

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
    if (!m.split(words, error) || !m.checkReferences(error) || !m.expandDecorationGroups(error))
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
                if (current == Section::Functions)
                    moveLines();
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

// OpLine before the first function belongs to the function.
void Module::moveLines()
{
    auto &globals = section(Section::Globals);
    const auto isLine = [](Instruction in) { return in.opcode == spv::OpLine || in.opcode == spv::OpNoLine; };
    const auto lines = std::find_if_not(globals.rbegin(), globals.rend(), isLine).base();
    section(Section::Functions).assign(lines, globals.end());
    globals.erase(lines, globals.end());
}

bool Module::define(Instruction in, bool global, std::string &error)
{
    const Id id = result(in);
    if (id == 0) {
        if (resultShape(in.opcode).hasResult)
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

// Decorations of groups become those of their targets (SPIR-V specification, 3.52.3: OpGroupDecorate).
bool Module::expandDecorationGroups(std::string &error)
{
    std::map<Id, std::vector<Instruction>> groups;
    auto &decorations = section(Section::Decorations);
    for (const Instruction in : decorations)
        if (in.opcode == spv::OpDecorationGroup)
            groups.try_emplace(result(in));
    if (groups.empty())
        return true;
    const auto groupOf = [&](Instruction in) { return groups.find(word(in, 1)); };
    const auto isOfGroup = [&](Instruction in) { return groupOf(in) != groups.end(); };
    for (const Instruction in : decorations)
        if (const auto group = groupOf(in); group != groups.end() && isDecoration(in.opcode))
            group->second.push_back(in);
    std::vector<Instruction> expanded;
    size_t added = 0; // words
    for (const Instruction in : std::vector(std::move(decorations))) {
        const bool members = in.opcode == spv::OpGroupMemberDecorate;
        if (!members && in.opcode != spv::OpGroupDecorate) {
            if (!isOfGroup(in))
                expanded.push_back(in);
            continue;
        }
        const auto group = groupOf(in);
        for (uint32_t i = 2; group != groups.end() && i + (members ? 1 : 0) < in.count; i += members ? 2 : 1) {
            for (const Instruction decoration : group->second) {
                const Words w = words(decoration);
                added += w.size();
                if (added > kMaxBound || w.size() == kMaxInstructionWords) {
                    error = "decoration groups have too many targets";
                    return false;
                }
                std::vector<uint32_t> operands(w.begin() + 1, w.end());
                operands[0] = word(in, i);
                if (members)
                    operands.insert(operands.begin() + 1, word(in, i + 1));
                expanded.push_back(make(members ? memberDecoration(decoration.opcode) : decoration.opcode, operands));
            }
        }
    }
    decorations = std::move(expanded);
    std::erase_if(section(Section::Names), isOfGroup);
    return true;
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
    const ResultShape shape = resultShape(in.opcode);
    return shape.hasResult ? word(in, shape.hasType ? 2 : 1) : 0;
}

Id Module::resultType(Instruction in) const
{
    return resultShape(in.opcode).hasType ? word(in, 1) : 0;
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

bool Module::hasExtension(const char *name) const
{
    return std::ranges::any_of(section(Section::Extensions),
                               [&](Instruction in) { return in.opcode == spv::OpExtension && string(in, 1) == name; });
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
