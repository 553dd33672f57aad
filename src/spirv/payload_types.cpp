// SPDX-License-Identifier: Apache-2.0
#include "spirv/payload_types.h"

#include <algorithm>
#include <string>

#include "spirv/entry_wrapper.h"
#include "spirv/module/numbers.h"
#include "spirv/module/uses.h"
#include "spirv/payload_prefix.h"

namespace vellum::spirv
{
namespace
{

// Bounds for malformed modules: a payload has a few dozen bytes.
constexpr size_t kMaxTypeWords = 4096;
constexpr int kMaxNesting = 64;

// The capability that numbers of another size than 32 bits need.
std::optional<uint32_t> capabilityOf(uint32_t opcode, uint32_t bits)
{
    const bool isFloat = opcode == spv::OpTypeFloat;
    switch (bits) {
    case 8: return isFloat ? std::nullopt : std::optional<uint32_t>(spv::CapabilityInt8);
    case 16: return isFloat ? spv::CapabilityFloat16 : spv::CapabilityInt16;
    case 64: return isFloat ? spv::CapabilityFloat64 : spv::CapabilityInt64;
    default: return {};
    }
}

// Appends the words of a type. False if it is unknown.
bool describe(const Module &module, const Types &types, Id type, int depth, TypeWords &out)
{
    const Instruction in = module.definition(type);
    out.push_back(in.opcode);
    if (depth > kMaxNesting || out.size() > kMaxTypeWords)
        return false;
    const auto member = [&](uint32_t word) { return describe(module, types, module.word(in, word), depth + 1, out); };
    switch (in.opcode) {
    case spv::OpTypeBool: return true;
    case spv::OpTypeInt:
    case spv::OpTypeFloat: {
        const uint32_t bits = module.word(in, 2);
        const auto capability = capabilityOf(in.opcode, bits);
        out.push_back(bits);
        if (in.opcode == spv::OpTypeInt)
            out.push_back(module.word(in, 3));
        // A float type with one more word has another encoding.
        return in.count == (in.opcode == spv::OpTypeInt ? 4 : 3) &&
               (bits == 32 || (capability && module.hasCapability(*capability)));
    }
    case spv::OpTypeVector:
    case spv::OpTypeMatrix: out.push_back(module.word(in, 3)); return member(2);
    case spv::OpTypeArray: {
        const auto length = types.valueOf(module.word(in, 3));
        out.push_back(length.value_or(0));
        return length && member(2);
    }
    case spv::OpTypeStruct:
        out.push_back(in.count - 2u);
        for (uint32_t i = 2; i < in.count; ++i)
            if (!member(i))
                return false;
        return true;
    default: return false;
    }
}

bool isInInterface(const Module &module, Instruction entry, Id variable)
{
    const Words words = module.words(entry);
    const auto name = static_cast<ptrdiff_t>(stringWords(module.string(entry, 3).c_str()).size());
    return std::find(words.begin() + std::min<ptrdiff_t>(3 + name, std::ssize(words)), words.end(), variable) !=
           words.end();
}

// All payloads of an entry point. Before SPIR-V 1.4, interfaces do not list payloads, so unused ones cannot be
// assigned.
std::vector<Id> payloadsOf(const Module &module, Instruction entry)
{
    std::vector<Id> payloads;
    const std::set<Id> reached = CallGraph(module).reachedFrom({module.word(entry, 2)});
    const Id incoming = incomingPayload(module, entry);
    for (const Instruction in : module.section(Section::Globals)) {
        if (in.opcode != spv::OpVariable || !PayloadPrefix::isPayload(module.word(in, 3)))
            continue;
        const Id variable = module.result(in);
        if (variable == incoming || (module.version() < kVersion14 ? usesPointer(module, reached, variable)
                                                                   : isInInterface(module, entry, variable)))
            payloads.push_back(variable);
    }
    return payloads;
}

class TypeMaker
{
public:
    TypeMaker(Module &module, Types &types, std::span<const uint32_t> words)
        : module_(module), types_(types), words_(words)
    {
    }

    // The next type; 0 if the words are not a type's.
    Id make(int depth)
    {
        if (depth > kMaxNesting)
            return 0;
        const uint32_t opcode = next();
        switch (opcode) {
        case spv::OpTypeBool: return types_.boolean();
        case spv::OpTypeInt: {
            const uint32_t bits = number(opcode);
            return types_.get(opcode, {bits, next()});
        }
        case spv::OpTypeFloat: return types_.get(opcode, {number(opcode)});
        case spv::OpTypeVector: {
            const uint32_t components = next();
            const Id component = make(depth + 1);
            return component == 0 ? 0 : types_.get(opcode, {component, components});
        }
        case spv::OpTypeMatrix: {
            const uint32_t columns = next();
            return matrix(make(depth + 1), columns);
        }
        case spv::OpTypeArray: {
            const uint32_t length = next();
            const Id element = make(depth + 1);
            return element == 0 ? 0 : aggregate(opcode, {element, types_.uintConstant(length)});
        }
        case spv::OpTypeStruct: {
            const uint32_t count = next();
            std::vector<uint32_t> members;
            for (uint32_t i = 0; i < count; ++i) {
                const Id member = make(depth + 1);
                if (member == 0)
                    return 0;
                members.push_back(member);
            }
            return aggregate(opcode, members);
        }
        default: return 0;
        }
    }

private:
    uint32_t next() { return at_ < words_.size() ? words_[at_++] : 0; }

    // The size of a number. Adds the capability that it needs.
    uint32_t number(uint32_t opcode)
    {
        const uint32_t bits = next();
        const auto capability = capabilityOf(opcode, bits);
        if (capability && !module_.hasCapability(*capability))
            module_.append(Section::Capabilities, spv::OpCapability, {*capability});
        return bits;
    }

    // There may be only one of a kind (SPIR-V specification, 2.8).
    Id matrix(Id column, uint32_t columns)
    {
        if (column == 0)
            return 0;
        for (const Instruction in : module_.section(Section::Globals))
            if (in.opcode == spv::OpTypeMatrix && module_.word(in, 2) == column && module_.word(in, 3) == columns)
                return module_.result(in);
        return aggregate(spv::OpTypeMatrix, {column, columns});
    }

    Id aggregate(uint32_t opcode, std::vector<uint32_t> operands)
    {
        const Id id = module_.newId();
        operands.insert(operands.begin(), id);
        module_.append(Section::Globals, opcode, operands);
        return id;
    }

    Module &module_;
    Types &types_;
    std::span<const uint32_t> words_;
    size_t at_ = 0;
};

} // namespace

void PayloadTypes::add(TypeWords type)
{
    if (!first_)
        first_ = std::move(type);
    else if (*first_ != type)
        differ_ = true;
}

std::optional<TypeWords> PayloadTypes::add(std::span<const uint32_t> words, std::string_view entryPoint,
                                           uint32_t executionModel)
{
    std::string error;
    std::optional<Module> module = Module::parse(words, error);
    if (!module) {
        differ_ = true;
        return TypeWords{};
    }
    std::optional<TypeWords> incoming;
    const Types types(*module);
    for (const Instruction entry : module->section(Section::EntryPoints)) {
        if (!isEntryPoint(*module, entry, {entryPoint, executionModel}))
            continue;
        const Id calledWith = incomingPayload(*module, entry);
        for (const Id variable : payloadsOf(*module, entry)) {
            const Instruction pointer = module->definition(module->resultType(module->definition(variable)));
            TypeWords type;
            if (!describe(*module, types, module->word(pointer, 3), 0, type))
                type.clear();
            if (variable == calledWith)
                incoming = type;
            if (type.empty())
                differ_ = true;
            else
                add(std::move(type));
        }
        break;
    }
    return incoming;
}

void PayloadTypes::add(const PayloadTypes &other)
{
    differ_ = differ_ || other.differ_;
    if (other.first_)
        add(*other.first_);
}

// An interface has at most one incoming payload ("Ray Tracing Pipeline Interface").
Id incomingPayload(const Module &module, Instruction entry)
{
    const bool hasInterface = module.version() >= kVersion14;
    const Id function = module.word(entry, 2);
    const std::set<Id> reached = hasInterface ? std::set<Id>{} : CallGraph(module).reachedFrom({function});
    std::vector<Id> declared;
    for (const Instruction in : module.section(Section::Globals)) {
        if (in.opcode != spv::OpVariable || module.word(in, 3) != spv::StorageClassIncomingRayPayloadKHR)
            continue;
        const Id variable = module.result(in);
        if (hasInterface ? isInInterface(module, entry, variable) : usesPointer(module, reached, variable))
            return variable;
        declared.push_back(variable);
    }
    // Before SPIR-V 1.4, interfaces do not list payloads. The only incoming payload of a module is this stage's, if no
    // other stage uses it.
    if (hasInterface || declared.size() != 1)
        return 0;
    std::vector<Id> all;
    for (const Instruction other : module.section(Section::EntryPoints))
        all.push_back(module.word(other, 2));
    return usesPointer(module, CallGraph(module).reachedFrom(std::move(all)), declared.front()) ? 0 : declared.front();
}

TypeWords PayloadTypes::common() const
{
    return first_ && !differ_ ? *first_ : TypeWords{};
}

Id makeType(Module &module, Types &types, std::span<const uint32_t> words)
{
    return TypeMaker(module, types, words).make(0);
}

} // namespace vellum::spirv
