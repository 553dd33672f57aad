// SPDX-License-Identifier: Apache-2.0
// The functions of vellum/spirv.h.
#include "vellum/spirv.h"

#include <memory>
#include <vector>

#include "library/call.h"
#include "spirv/module/micromap_mode.h"

namespace vellum::library
{
VELLUM_STRUCTURE(VellumSpirvOptions, userData);
VELLUM_STRUCTURE(VellumSpirvInfo, reserved);
VELLUM_STRUCTURE(VellumSpirvEntryPointInfo, constantDefault);

VellumSpirvOptions Structure<VellumSpirvOptions>::defaults()
{
    VellumSpirvOptions options{};
    options.structSize = sizeof options;
    options.edit = VELLUM_SPIRV_EDIT_ENABLE;
    return options;
}
} // namespace vellum::library

using namespace vellum;
using namespace vellum::library;

struct VellumSpirv {
    std::vector<uint32_t> words;
    std::vector<spirv::EntryPoint> entryPoints;
    bool changed = false;
};

namespace
{

spirv::ModeEdit editOf(const VellumSpirvOptions &options)
{
    using To = spirv::ModeEdit::To;
    spirv::ModeEdit edit;
    switch (options.edit) {
    case VELLUM_SPIRV_EDIT_ENABLE: edit.to = To::Always; break;
    case VELLUM_SPIRV_EDIT_ENABLE_BY_CONSTANT: edit.to = To::Specialized; break;
    case VELLUM_SPIRV_EDIT_DISABLE: edit.to = To::Absent; break;
    default: throw invalid("edit is " + std::to_string(options.edit) + ", not a VellumSpirvEdit");
    }
    if (options.constantDefault > 1)
        throw invalid("constantDefault is " + std::to_string(options.constantDefault) + ", not 0 or 1");
    edit.constantId = options.constantId;
    edit.initial = options.constantDefault == 1;
    if (options.entryPointCount != 0 && options.entryPoints == nullptr)
        throw invalid("entryPoints is null");
    for (size_t i = 0; i < options.entryPointCount; ++i) {
        if (options.entryPoints[i] == nullptr)
            throw invalid("entryPoints[" + std::to_string(i) + "] is null");
        edit.entryPoints.emplace_back(options.entryPoints[i]);
    }
    return edit;
}

std::unique_ptr<VellumSpirv> editModule(std::span<const uint32_t> words, const VellumSpirvOptions &options)
{
    if (options.reserved != 0)
        throw invalid("reserved is not 0");
    auto made = std::make_unique<VellumSpirv>();
    if (options.edit != VELLUM_SPIRV_EDIT_NONE) {
        spirv::ModeResult result = spirv::editMicromapMode(words, editOf(options));
        if (!result.error.empty())
            throw invalid("the module: " + result.error);
        made->words = std::move(result.words);
    }
    made->changed = !made->words.empty();
    if (!made->changed)
        made->words.assign(words.begin(), words.end());
    std::string error;
    auto entryPoints = spirv::readEntryPoints(made->words, error);
    if (!entryPoints)
        throw invalid("the module: " + error);
    made->entryPoints = std::move(*entryPoints);
    return made;
}

VellumSpirvMode modeOf(spirv::MicromapMode::When when)
{
    using When = spirv::MicromapMode::When;
    switch (when) {
    case When::Absent: return VELLUM_SPIRV_MODE_ABSENT;
    case When::Never: return VELLUM_SPIRV_MODE_FALSE;
    case When::Always: return VELLUM_SPIRV_MODE_TRUE;
    case When::Specialized: return VELLUM_SPIRV_MODE_CONSTANT;
    case When::Computed: return VELLUM_SPIRV_MODE_COMPUTED;
    case When::Invalid: break;
    }
    return VELLUM_SPIRV_MODE_INVALID;
}

} // namespace

void vellumInitSpirvOptions(VellumSpirvOptions *options, size_t structSize)
{
    initialize(options, structSize);
}

VellumResult vellumEditSpirv(const uint32_t *words, size_t wordCount, const VellumSpirvOptions *options,
                             VellumSpirv **spirv)
{
    if (spirv != nullptr)
        *spirv = nullptr;
    return guardedWith(options, [&](const VellumSpirvOptions &known) {
        if (spirv == nullptr)
            throw invalid("there is no place for the result");
        if (words == nullptr)
            throw invalid("there are no words");
        *spirv = editModule({words, wordCount}, known).release();
    });
}

void vellumDestroySpirv(VellumSpirv *spirv)
{
    delete spirv;
}

VellumResult vellumGetSpirvInfo(const VellumSpirv *spirv, VellumSpirvInfo *info)
{
    return guarded([&] {
        if (spirv == nullptr)
            throw invalid("there is no module");
        VellumSpirvInfo values{};
        values.words = spirv->words.data();
        values.wordCount = spirv->words.size();
        values.entryPointCount = spirv->entryPoints.size();
        values.changed = spirv->changed ? 1 : 0;
        fill(info, values);
    });
}

VellumResult vellumGetSpirvEntryPointInfo(const VellumSpirv *spirv, size_t number, VellumSpirvEntryPointInfo *info)
{
    return guarded([&] {
        if (spirv == nullptr)
            throw invalid("there is no module");
        if (number >= spirv->entryPoints.size())
            throw invalid("there is no such entry point");
        const spirv::EntryPoint &entry = spirv->entryPoints[number];
        VellumSpirvEntryPointInfo values{};
        values.name = entry.name.c_str();
        values.executionModel = entry.model;
        values.rayQueries = entry.queries ? 1 : 0;
        values.tracesRays = entry.traces ? 1 : 0;
        values.mode = static_cast<uint32_t>(modeOf(entry.mode.when));
        values.constantId = entry.mode.constantId;
        values.constantDefault = entry.mode.initial ? 1 : 0;
        fill(info, values);
    });
}
