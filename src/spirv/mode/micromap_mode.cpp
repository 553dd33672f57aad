// SPDX-License-Identifier: Apache-2.0
#include "spirv/mode/micromap_mode.h"

#include <algorithm>

#include "spirv/mode/outline.h"
#include "spirv/module/numbers.h"

namespace vellum::spirv
{
namespace
{

using When = MicromapMode::When;
using To = ModeEdit::To;

constexpr uint32_t kMaxBound = 4'194'303; // universal limit of ids (SPIR-V specification, 2.17)

MicromapMode modeOf(const Outline &outline, uint32_t operand)
{
    const auto constant = outline.booleans.find(operand);
    if (constant == outline.booleans.end())
        return {When::Invalid};
    switch (constant->second) {
    case Op::ConstantTrue: return {When::Always};
    case Op::ConstantFalse:
    case Op::ConstantNull: return {When::Never};
    case Op::SpecConstantTrue:
    case Op::SpecConstantFalse: {
        const bool initial = constant->second == Op::SpecConstantTrue;
        const auto id = outline.specIds.find(operand);
        if (id == outline.specIds.end()) // nothing can specialize it
            return {initial ? When::Always : When::Never};
        return {When::Specialized, id->second, initial};
    }
    default: return {When::Computed};
    }
}

MicromapMode modeOfFunction(const Outline &outline, uint32_t function)
{
    MicromapMode mode;
    uint32_t operand = 0;
    for (const Outline::Mode &in : outline.modes) {
        if (in.function != function)
            continue;
        if (mode.when != When::Absent && in.operand != operand)
            return {When::Invalid};
        operand = in.operand;
        mode = modeOf(outline, operand);
    }
    return mode;
}

std::string namesIn(const Outline &outline)
{
    std::string names;
    for (const Outline::EntryPoint &entry : outline.entryPoints)
        names += (names.empty() ? "" : ", ") + entry.name;
    return names.empty() ? "no entry points" : names;
}

void put(std::vector<uint32_t> &out, Op op, std::initializer_list<uint32_t> operands)
{
    out.push_back(static_cast<uint32_t>(operands.size() + 1) << 16 | static_cast<uint32_t>(op));
    out.insert(out.end(), operands);
}

// One edit of a module.
class Edit
{
public:
    Edit(Words words, const ModeEdit &wanted) : words_(words), wanted_(wanted) {}

    ModeResult run()
    {
        std::optional<Outline> outline = Outline::read(words_, error_);
        if (!outline)
            return {{}, error_};
        outline_ = std::move(*outline);
        if (!chooseTargets() || !isNeeded())
            return {{}, error_};
        if (wanted_.to != To::Absent && (!checkModule() || !chooseConstant()))
            return {{}, error_};
        return {write(), {}};
    }

private:
    bool fail(std::string error)
    {
        error_ = std::move(error);
        return false;
    }

    // The functions of the entry points to edit.
    bool chooseTargets()
    {
        for (const std::string &name : wanted_.entryPoints)
            if (std::ranges::find(outline_.entryPoints, name, &Outline::EntryPoint::name) == outline_.entryPoints.end())
                return fail("there is no entry point " + name + "; the module has " + namesIn(outline_));
        const std::set<uint32_t> queries = outline_.reaching(&Outline::Function::queries);
        for (const Outline::EntryPoint &entry : outline_.entryPoints) {
            const bool chosen = wanted_.entryPoints.empty()
                                    ? wanted_.to == To::Absent || queries.contains(entry.function)
                                    : std::ranges::find(wanted_.entryPoints, entry.name) != wanted_.entryPoints.end();
            if (chosen)
                targets_.insert(entry.function);
        }
        return true;
    }

    // Whether any entry point or declaration is not what it should be.
    bool isNeeded()
    {
        if (targets_.empty())
            return false;
        if (wanted_.to == To::Absent)
            return removesAny() || (!keepsModes() && outline_.hasModeCapability);
        const MicromapMode wanted = wanted_.to == To::Always
                                        ? MicromapMode{When::Always}
                                        : MicromapMode{When::Specialized, wanted_.constantId, wanted_.initial};
        return !outline_.hasModeCapability || !outline_.hasKhr ||
               std::ranges::any_of(targets_, [&](uint32_t f) { return modeOfFunction(outline_, f) != wanted; });
    }

    [[nodiscard]] bool removesAny() const
    {
        return std::ranges::any_of(outline_.modes, [&](const auto &mode) { return targets_.contains(mode.function); });
    }
    // Whether entry points that are not edited have the mode.
    [[nodiscard]] bool keepsModes() const
    {
        return std::ranges::any_of(outline_.modes, [&](const auto &mode) { return !targets_.contains(mode.function); });
    }

    bool checkModule()
    {
        const uint32_t version = words_[1];
        if (version < 0x10400)
            return fail("SPV_KHR_opacity_micromap needs SPIR-V 1.4; the module has " + std::to_string(version >> 16) +
                        "." + std::to_string(version >> 8 & 0xff));
        bound_ = words_[3];
        constexpr uint32_t kMostNewIds = 2;
        if (bound_ == 0 || bound_ > kMaxBound - kMostNewIds)
            return fail("the bound of its ids is " + std::to_string(bound_));
        return true;
    }

    // Finds the operand of the mode, or sets `makesConstant_`.
    bool chooseConstant()
    {
        if (wanted_.to == To::Always) {
            const auto found = std::ranges::find(outline_.booleans, Op::ConstantTrue,
                                                 [](const auto &constant) { return constant.second; });
            if (found != outline_.booleans.end())
                constant_ = found->first;
        } else if (const auto found = std::ranges::find(outline_.specIds, wanted_.constantId,
                                                        [](const auto &id) { return id.second; });
                   found != outline_.specIds.end()) {
            constant_ = found->first;
            const std::string name = "the specialization constant " + std::to_string(wanted_.constantId);
            const MicromapMode known = modeOf(outline_, constant_);
            if (known.when != When::Specialized)
                return fail(name + " of the module is not of type bool");
            if (known.initial != wanted_.initial)
                return fail(name + " of the module has the default " + (known.initial ? "true" : "false"));
        }
        if (constant_ != 0)
            return true;
        makesConstant_ = true;
        makesType_ = outline_.boolType == 0;
        if (makesType_)
            outline_.boolType = bound_++;
        constant_ = bound_++;
        return true;
    }

    // What is inserted at a position; empty at most positions.
    [[nodiscard]] std::vector<uint32_t> insertedAt(size_t position) const
    {
        std::vector<uint32_t> out;
        if (wanted_.to == To::Absent)
            return out;
        if (position == outline_.capabilities && !outline_.hasModeCapability)
            put(out, Op::Capability, {kCapabilityOpacityMicromapExecutionMode});
        if (position == outline_.extensions && !outline_.hasKhr)
            putExtension(out);
        if (position == outline_.executionModes)
            for (const uint32_t function : targets_)
                put(out, Op::ExecutionModeId, {function, kExecutionModeOpacityMicromapId, constant_});
        if (position == outline_.decorations && makesConstant_ && wanted_.to == To::Specialized)
            put(out, Op::Decorate, {constant_, kDecorationSpecId, wanted_.constantId});
        if (position == outline_.globals)
            putConstant(out);
        return out;
    }

    static void putExtension(std::vector<uint32_t> &out)
    {
        const std::string name = kKhrExtension;
        std::vector<uint32_t> text(name.size() / 4 + 1);
        for (size_t i = 0; i < name.size(); ++i)
            text[i / 4] |= static_cast<uint32_t>(static_cast<unsigned char>(name[i])) << (i % 4 * 8);
        put(out, Op::Extension, {});
        out.back() += static_cast<uint32_t>(text.size()) << 16;
        out.insert(out.end(), text.begin(), text.end());
    }

    void putConstant(std::vector<uint32_t> &out) const
    {
        if (makesType_)
            put(out, Op::TypeBool, {outline_.boolType});
        if (!makesConstant_)
            return;
        const Op op = wanted_.to == To::Always ? Op::ConstantTrue
                      : wanted_.initial        ? Op::SpecConstantTrue
                                               : Op::SpecConstantFalse;
        put(out, op, {outline_.boolType, constant_});
    }

    [[nodiscard]] bool isRemoved(Words in) const
    {
        if (isMicromapMode(in))
            return targets_.contains(in[1]);
        if (wanted_.to != To::Absent || keepsModes())
            return false;
        if (opcodeOf(in) == static_cast<uint32_t>(Op::Capability))
            return in[1] == kCapabilityOpacityMicromapExecutionMode;
        // The extension has the capability of a ray flag as well.
        return opcodeOf(in) == static_cast<uint32_t>(Op::Extension) &&
               (!outline_.hasFlagCapability || outline_.hasExt) && textOf(in.subspan(1)) == kKhrExtension;
    }

    std::vector<uint32_t> write()
    {
        std::vector<uint32_t> out(words_.begin(), words_.begin() + kHeaderWords);
        const auto insertAt = [&](size_t position) {
            const std::vector<uint32_t> inserted = insertedAt(position);
            out.insert(out.end(), inserted.begin(), inserted.end());
        };
        insertAt(kHeaderWords);
        size_t position = kHeaderWords;
        while (position < outline_.globals) {
            const Words in = words_.subspan(position, words_[position] >> 16);
            if (!isRemoved(in))
                out.insert(out.end(), in.begin(), in.end());
            position += in.size();
            insertAt(position);
        }
        out.insert(out.end(), words_.begin() + static_cast<ptrdiff_t>(position), words_.end());
        if (wanted_.to != To::Absent)
            out[3] = bound_;
        return out;
    }

    Words words_;
    const ModeEdit &wanted_;
    Outline outline_;
    std::set<uint32_t> targets_; // functions
    uint32_t bound_ = 0;
    uint32_t constant_ = 0; // operand of the mode
    bool makesConstant_ = false, makesType_ = false;
    std::string error_;
};

} // namespace

std::optional<std::vector<EntryPoint>> readEntryPoints(std::span<const uint32_t> words, std::string &error)
{
    const std::optional<Outline> outline = Outline::read(words, error);
    if (!outline)
        return {};
    const std::set<uint32_t> queries = outline->reaching(&Outline::Function::queries);
    const std::set<uint32_t> traces = outline->reaching(&Outline::Function::traces);
    std::vector<EntryPoint> entries;
    for (const Outline::EntryPoint &entry : outline->entryPoints)
        entries.push_back({entry.name, entry.model, queries.contains(entry.function), traces.contains(entry.function),
                           modeOfFunction(*outline, entry.function)});
    return entries;
}

ModeResult editMicromapMode(std::span<const uint32_t> words, const ModeEdit &edit)
{
    return Edit(words, edit).run();
}

} // namespace vellum::spirv
