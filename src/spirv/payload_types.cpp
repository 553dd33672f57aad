#include "spirv/payload_types.h"

#include <algorithm>
#include <string>

#include "spirv/entry_wrapper.h"
#include "spirv/module/opcodes.h"
#include "spirv/payload_prefix.h"

namespace vellum::spirv
{
namespace
{

// Bounds on what is looked at and made: a payload has a few dozen bytes.
constexpr std::size_t kMaxTypeWords = 4096;
constexpr int kMaxNesting = 64;

// What a module must declare to use a number of other than 32 bits, wherever that is.
std::optional<std::uint32_t> capabilityOf(std::uint32_t opcode, std::uint32_t bits)
{
    const bool isFloat = opcode == spv::OpTypeFloat;
    switch (bits) {
    case 8: return isFloat ? std::nullopt : std::optional<std::uint32_t>(spv::CapabilityInt8);
    case 16: return isFloat ? spv::CapabilityFloat16 : spv::CapabilityInt16;
    case 64: return isFloat ? spv::CapabilityFloat64 : spv::CapabilityInt64;
    default: return {};
    }
}

// Appends what a type is. False where that is not known.
bool describe(const Module &module, const Types &types, Id type, int depth, TypeWords &out)
{
    const Instruction in = module.definition(type);
    out.push_back(in.opcode);
    if (depth > kMaxNesting || out.size() > kMaxTypeWords)
        return false;
    const auto member = [&](std::uint32_t word) {
        return describe(module, types, module.word(in, word), depth + 1, out);
    };
    switch (in.opcode) {
    case spv::OpTypeBool: return true;
    case spv::OpTypeInt:
    case spv::OpTypeFloat: {
        const std::uint32_t bits = module.word(in, 2);
        const auto capability = capabilityOf(in.opcode, bits);
        out.push_back(bits);
        if (in.opcode == spv::OpTypeInt)
            out.push_back(module.word(in, 3));
        // A float with one word more has an encoding of its own.
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
        for (std::uint32_t i = 2; i < in.count; ++i)
            if (!member(i))
                return false;
        return true;
    default: return false;
    }
}

class TypeMaker
{
public:
    TypeMaker(Module &module, Types &types, std::span<const std::uint32_t> words)
        : module_(module), types_(types), words_(words)
    {
    }

    // The next type; 0 where the words are not one's.
    Id make(int depth)
    {
        if (depth > kMaxNesting)
            return 0;
        const std::uint32_t opcode = next();
        switch (opcode) {
        case spv::OpTypeBool: return types_.boolean();
        case spv::OpTypeInt: {
            const std::uint32_t bits = number(opcode);
            return types_.get(opcode, {bits, next()});
        }
        case spv::OpTypeFloat: return types_.get(opcode, {number(opcode)});
        case spv::OpTypeVector: {
            const std::uint32_t components = next();
            const Id component = make(depth + 1);
            return component == 0 ? 0 : types_.get(opcode, {component, components});
        }
        case spv::OpTypeMatrix: {
            const std::uint32_t columns = next();
            return matrix(make(depth + 1), columns);
        }
        case spv::OpTypeArray: {
            const std::uint32_t length = next();
            const Id element = make(depth + 1);
            return element == 0 ? 0 : aggregate(opcode, {element, types_.uintConstant(length)});
        }
        case spv::OpTypeStruct: {
            const std::uint32_t count = next();
            std::vector<std::uint32_t> members;
            for (std::uint32_t i = 0; i < count; ++i) {
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
    std::uint32_t next() { return at_ < words_.size() ? words_[at_++] : 0; }

    // The bits of a number, for which the module declares what it must.
    std::uint32_t number(std::uint32_t opcode)
    {
        const std::uint32_t bits = next();
        const auto capability = capabilityOf(opcode, bits);
        if (capability && !module_.hasCapability(*capability))
            module_.append(Section::Capabilities, spv::OpCapability, {*capability});
        return bits;
    }

    // There may be only one of a kind (SPIR-V specification, 2.8).
    Id matrix(Id column, std::uint32_t columns)
    {
        if (column == 0)
            return 0;
        for (const Instruction in : module_.section(Section::Globals))
            if (in.opcode == spv::OpTypeMatrix && module_.word(in, 2) == column && module_.word(in, 3) == columns)
                return module_.result(in);
        return aggregate(spv::OpTypeMatrix, {column, columns});
    }

    Id aggregate(std::uint32_t opcode, std::vector<std::uint32_t> operands)
    {
        const Id id = module_.newId();
        operands.insert(operands.begin(), id);
        module_.append(Section::Globals, opcode, operands);
        return id;
    }

    Module &module_;
    Types &types_;
    std::span<const std::uint32_t> words_;
    std::size_t at_ = 0;
};

} // namespace

void PayloadTypes::add(TypeWords type)
{
    if (!first_)
        first_ = std::move(type);
    else if (*first_ != type)
        differ_ = true;
}

void PayloadTypes::add(std::span<const std::uint32_t> words, std::string_view entryPoint, std::uint32_t executionModel)
{
    std::string error;
    std::optional<Module> module = Module::parse(words, error);
    if (!module) {
        differ_ = true;
        return;
    }
    const Types types(*module);
    for (const Instruction entry : module->section(Section::EntryPoints)) {
        if (!isEntryPoint(*module, entry, {entryPoint, executionModel}))
            continue;
        const Words interface = module->words(entry);
        for (const Instruction in : module->section(Section::Globals)) {
            if (in.opcode != spv::OpVariable || !PayloadPrefix::isPayload(module->word(in, 3)))
                continue;
            // Before SPIR-V 1.4 no interface says whose payload it is.
            if (module->version() >= kVersion14 &&
                std::find(interface.begin() + 3, interface.end(), module->result(in)) == interface.end())
                continue;
            TypeWords type;
            if (describe(*module, types, module->word(module->definition(module->word(in, 1)), 3), 0, type))
                add(std::move(type));
            else
                differ_ = true;
        }
    }
}

void PayloadTypes::add(const PayloadTypes &other)
{
    differ_ = differ_ || other.differ_;
    if (other.first_)
        add(*other.first_);
}

TypeWords PayloadTypes::common() const
{
    return first_ && !differ_ ? *first_ : TypeWords{};
}

Id makeType(Module &module, Types &types, std::span<const std::uint32_t> words)
{
    return TypeMaker(module, types, words).make(0);
}

} // namespace vellum::spirv
