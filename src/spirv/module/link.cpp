// SPDX-License-Identifier: Apache-2.0
#include "spirv/module/link.h"

#include "spirv/module/numbers.h"

#include <algorithm>

namespace vellum::spirv
{
namespace
{

constexpr uint32_t kAllIds = UINT32_MAX;

// First word of an instruction that is a literal, as are all words after it; 0 for unsupported opcodes. Covers what
// glslang makes of lookup.comp, the only library; a test links all of it.
uint32_t firstLiteral(uint32_t opcode)
{
    switch (opcode) {
    case spv::OpTypeInt:
    case spv::OpTypeFloat: return 2;
    case spv::OpTypeVector:
    case spv::OpConstant:
    case spv::OpSpecConstant:
    case spv::OpVariable: return 3;
    case spv::OpTypePointer: return 2; // storage class; the type behind it is handled by the caller
    case spv::OpStore: return 3;
    case spv::OpLoad:
    case spv::OpCompositeExtract:
    case spv::OpBranchConditional: return 4;
    case spv::OpVectorShuffle: return 5;
    case spv::OpSelectionMerge: return 2;
    case spv::OpLoopMerge: return 3;
    case spv::OpTypeVoid:
    case spv::OpTypeBool:
    case spv::OpTypeArray:
    case spv::OpTypeRuntimeArray:
    case spv::OpTypeStruct:
    case spv::OpTypeFunction:
    case spv::OpConstantTrue:
    case spv::OpConstantFalse:
    case spv::OpConstantNull:
    case spv::OpConstantComposite:
    case spv::OpFunctionParameter:
    case spv::OpFunctionCall:
    case spv::OpFunctionEnd:
    case spv::OpLabel:
    case spv::OpBranch:
    case spv::OpReturn:
    case spv::OpReturnValue:
    case spv::OpUnreachable:
    case spv::OpAccessChain:
    case spv::OpInBoundsAccessChain:
    case spv::OpCompositeConstruct:
    case spv::OpPhi: return kAllIds;
    default: break;
    }
    const bool arithmetic = opcode >= spv::OpConvertFToU && opcode <= spv::OpFUnordGreaterThanEqual;
    const bool bitwise = opcode >= spv::OpShiftRightLogical && opcode <= spv::OpBitCount;
    return arithmetic || bitwise ? kAllIds : 0;
}

} // namespace

Linker::Linker(Module &module, Types &types, Words library, std::map<uint32_t, uint32_t> constants)
    : module_(module), types_(types), library_(Module::parse(library, error_)), constants_(std::move(constants))
{
    if (!library_)
        return;
    for (const Instruction in : library_->section(Section::Decorations)) {
        if (in.opcode != spv::OpDecorate)
            continue;
        decorated_.insert(library_->word(in, 1));
        if (library_->word(in, 2) == spv::DecorationSpecId)
            specIds_[library_->word(in, 1)] = library_->word(in, 3);
    }
    const auto &code = library_->section(Section::Functions);
    for (size_t i = 0; i < code.size(); ++i)
        if (code[i].opcode == spv::OpFunction)
            functions_[library_->result(code[i])] = i;
}

Id Linker::fail(const std::string &what)
{
    if (error_.empty())
        error_ = "lookup library: " + what;
    return 0;
}

Id Linker::function(std::string_view name)
{
    if (!error_.empty())
        return 0;
    // glslang names functions "name(parameter types;".
    for (const Instruction in : library_->section(Section::Names)) {
        const std::string mangled = library_->string(in, 2);
        if (in.opcode == spv::OpName && mangled.substr(0, mangled.find('(')) == name &&
            functions_.contains(library_->word(in, 1)))
            return import(library_->word(in, 1));
    }
    return fail("no function " + std::string(name));
}

Id Linker::import(Id id)
{
    if (const auto it = loaded_.find(id); it != loaded_.end())
        return import(it->second);
    if (const auto it = imported_.find(id); it != imported_.end())
        return it->second;
    const Instruction in = library_->definition(id);
    if (in.opcode == spv::OpFunction)
        return importFunction(id);
    if (in.opcode == spv::OpExtInstImport)
        return importInstructionSet(in);
    return importGlobal(in, id);
}

Id Linker::importInstructionSet(Instruction in)
{
    const Id set = library_->result(in);
    merged_.insert(set);
    for (const Instruction known : module_.section(Section::Imports))
        if (known.opcode == spv::OpExtInstImport && module_.string(known, 2) == library_->string(in, 2))
            return imported_[set] = module_.result(known);
    const Id mine = module_.newId();
    std::vector<uint32_t> operands = stringWords(library_->string(in, 2).c_str());
    operands.insert(operands.begin(), mine);
    module_.append(Section::Imports, spv::OpExtInstImport, operands);
    return imported_[set] = mine;
}

Id Linker::importGlobal(Instruction in, Id id)
{
    uint32_t opcode = in.opcode;
    if (opcode == spv::OpSpecConstantComposite)
        opcode = spv::OpConstantComposite;
    const uint32_t literals = firstLiteral(opcode);
    if (literals == 0 || !library_->isGlobal(id))
        return fail("cannot import opcode " + std::to_string(opcode));
    const uint32_t resultWord = library_->resultType(in) != 0 ? 2 : 1;
    std::vector<uint32_t> operands; // without the result
    for (uint32_t i = 1; i < in.count; ++i) {
        if (i == resultWord)
            continue;
        const bool isId = i < literals || (opcode == spv::OpTypePointer && i == 3);
        const uint32_t operand = isId ? import(library_->word(in, i)) : library_->word(in, i);
        if (!error_.empty())
            return 0;
        operands.push_back(operand);
    }
    if (opcode == spv::OpSpecConstant) {
        const auto value = constants_.find(specIds_[id]);
        if (value == constants_.end())
            return fail("no value for a specialization constant");
        opcode = spv::OpConstant;
        operands[1] = value->second;
        merged_.insert(id);
    }
    if (Types::isUnique(opcode)) {
        const Id mine = types_.get(opcode, std::move(operands));
        merged_.insert(id);
        return imported_[id] = mine;
    }
    const Id mine = module_.newId();
    operands.insert(operands.begin() + (resultWord - 1), mine);
    module_.append(Section::Globals, opcode, operands);
    return imported_[id] = mine;
}

std::span<const Instruction> Linker::bodyOf(Id function) const
{
    const auto &code = library_->section(Section::Functions);
    const auto begin = code.begin() + static_cast<ptrdiff_t>(functions_.at(function));
    const auto end = std::ranges::find(begin, code.end(), spv::OpFunctionEnd, &Instruction::opcode);
    return {begin, end + 1};
}

// Gives new ids to the results of a function's body. Returns the instructions that are copied.
std::vector<Instruction> Linker::newResults(std::span<const Instruction> body)
{
    const std::map<Id, Id> constants = localConstants(body);
    std::vector<Instruction> copied;
    for (const Instruction in : body) {
        const bool isVariable = in.opcode == spv::OpVariable && constants.contains(library_->result(in));
        const bool isStore = in.opcode == spv::OpStore && constants.contains(library_->word(in, 1));
        if (isVariable || isStore)
            continue;
        if (in.opcode == spv::OpLoad && constants.contains(library_->word(in, 3))) {
            loaded_[library_->result(in)] = constants.at(library_->word(in, 3));
            continue;
        }
        if (const Id result = library_->result(in); result != 0 && in.opcode != spv::OpFunction)
            imported_[result] = module_.newId();
        copied.push_back(in);
    }
    return copied;
}

Id Linker::importFunction(Id id)
{
    const Id mine = module_.newId();
    imported_[id] = mine;
    std::vector<Instruction> imported;
    if (!importBody(newResults(bodyOf(id)), imported))
        return 0;
    code_.insert(code_.end(), imported.begin(), imported.end());
    return mine;
}

// Calls of functions that are one block without variables. Drivers compile code without them faster.
bool Linker::isInlined(std::span<const Instruction> body) const
{
    const std::map<Id, Id> constants = localConstants(body);
    return std::ranges::count(body, spv::OpLabel, &Instruction::opcode) == 1 &&
           std::ranges::count(body, spv::OpReturnValue, &Instruction::opcode) == 1 &&
           std::ranges::none_of(body, [&](Instruction in) {
               const Id result = library_->result(in);
               return decorated_.contains(result) || (in.opcode == spv::OpVariable && !constants.contains(result));
           });
}

// What is called is copied for each call, so its results have new ids each time. The result of the call is what is
// returned; nothing refers to it before, since only phis of loops would.
bool Linker::inlineCall(Instruction call, std::vector<Instruction> &out)
{
    const std::vector<Instruction> body = newResults(bodyOf(library_->word(call, 3)));
    std::vector<Instruction> copied;
    uint32_t argument = 4;
    for (const Instruction in : body) {
        switch (in.opcode) {
        case spv::OpFunctionParameter:
            imported_[library_->result(in)] = import(library_->word(call, argument++));
            break;
        case spv::OpFunction:
        case spv::OpLabel:
        case spv::OpReturnValue:
        case spv::OpFunctionEnd: break;
        default: copied.push_back(in); break;
        }
    }
    if (!importBody(copied, out))
        return false;
    const Instruction returned = *std::ranges::find(body, spv::OpReturnValue, &Instruction::opcode);
    imported_[library_->result(call)] = import(library_->word(returned, 1));
    return error_.empty();
}

// Local variables that are stored once, before they are loaded, and not used in another way, with what is stored. These
// are what glslang makes of constants. Drivers compile code without them faster.
std::map<Id, Id> Linker::localConstants(std::span<const Instruction> body) const
{
    std::map<Id, Id> values; // 0: not a constant
    for (const Instruction in : body) {
        if (in.opcode == spv::OpVariable)
            continue;
        const bool isStore = in.opcode == spv::OpStore;
        for (uint32_t i = 1; i < in.count; ++i) {
            const Id id = library_->word(in, i);
            if (library_->definition(id).opcode != spv::OpVariable)
                continue;
            const auto [known, isFirst] = values.try_emplace(id, isStore ? library_->word(in, 2) : 0);
            if (!isFirst && in.opcode != spv::OpLoad)
                known->second = 0;
        }
    }
    std::erase_if(values, [](const auto &value) { return value.second == 0; });
    return values;
}

bool Linker::importBody(std::span<const Instruction> body, std::vector<Instruction> &out)
{
    for (const Instruction in : body) {
        if (in.opcode == spv::OpLine || in.opcode == spv::OpNoLine)
            continue;
        if (in.opcode == spv::OpFunctionCall && isInlined(bodyOf(library_->word(in, 3)))) {
            if (!inlineCall(in, out))
                return false;
            continue;
        }
        const bool isFunction = in.opcode == spv::OpFunction;
        const bool isExtended = in.opcode == spv::OpExtInst;
        const uint32_t literals = isFunction ? 3 : isExtended ? 4 : firstLiteral(in.opcode);
        if (literals == 0) {
            fail("cannot import opcode " + std::to_string(in.opcode));
            return false;
        }
        std::vector<uint32_t> operands;
        for (uint32_t i = 1; i < in.count; ++i) {
            const bool isId = i < literals || (isFunction && i == 4) || (isExtended && i > 4);
            const uint32_t operand = library_->word(in, i);
            operands.push_back(isId ? import(operand) : operand);
            if (!error_.empty())
                return false;
        }
        out.push_back(module_.make(in.opcode, operands));
    }
    return true;
}

bool Linker::finish()
{
    if (!error_.empty())
        return false;
    auto &functions = module_.section(Section::Functions);
    functions.insert(functions.end(), code_.begin(), code_.end());
    if (imported_.empty())
        return true;
    importDecorations();
    return declareAddressing();
}

void Linker::importDecorations()
{
    const auto copy = [&](Section section, Instruction in) {
        const auto target = imported_.find(library_->word(in, 1));
        if (target == imported_.end() || merged_.contains(target->first))
            return;
        const Words w = library_->words(in);
        std::vector<uint32_t> operands(w.begin() + 1, w.end());
        operands[0] = target->second;
        module_.append(section, in.opcode, operands);
    };
    for (const Instruction in : library_->section(Section::Names))
        if (in.opcode == spv::OpName && library_->definition(library_->word(in, 1)).opcode == spv::OpFunction)
            copy(Section::Names, in);
    for (const Instruction in : library_->section(Section::Decorations))
        if (in.opcode == spv::OpDecorate || in.opcode == spv::OpMemberDecorate)
            copy(Section::Decorations, in);
}

bool Linker::declareAddressing()
{
    auto &models = module_.section(Section::MemoryModel);
    const auto model = std::ranges::find(models, spv::OpMemoryModel, &Instruction::opcode);
    switch (module_.word(*model, 1)) {
    case spv::AddressingModelLogical:
        *model = module_.with(*model, 1, spv::AddressingModelPhysicalStorageBuffer64);
        break;
    case spv::AddressingModelPhysicalStorageBuffer64: break;
    default: error_ = "addressing model is neither Logical nor PhysicalStorageBuffer64"; return false;
    }
    if (!module_.hasCapability(spv::CapabilityPhysicalStorageBufferAddresses))
        module_.append(Section::Capabilities, spv::OpCapability, {spv::CapabilityPhysicalStorageBufferAddresses});
    if (module_.version() >= kVersion15)
        return true;
    const char *name = "SPV_KHR_physical_storage_buffer";
    for (const Instruction in : module_.section(Section::Extensions))
        if (in.opcode == spv::OpExtension && module_.string(in, 1) == name)
            return true;
    module_.append(Section::Extensions, spv::OpExtension, stringWords(name));
    return true;
}

} // namespace vellum::spirv
