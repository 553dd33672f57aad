// SPDX-License-Identifier: Apache-2.0
// Fuzz target of all that reads an application's SPIR-V: the rewriter, the translation to EXT, the execution mode, the
// types of payloads, and validation's marks. Whatever the words are, they read nothing outside them, end soon, and
// return the same each time; what they return is a module.
#include <cstring>
#include <memory>

#include "check.h"
#include "spirv/module/khr_to_ext.h"
#include "spirv/module/micromap_mode.h"
#include "spirv/module/module.h"
#include "spirv/payload_types.h"
#include "spirv/sites/trace_sites.h"
#include "spirv_input.h"

using namespace vellum;

namespace
{

using Status = spirv::RewriteResult::Status;

// The universal limit of ids (SPIR-V specification, 2.17), less than what the rewriter may need for its own.
constexpr uint32_t kFewerThanAllIds = 4'000'000;

// Words that are made of a module's are a module as well.
void checkMade(std::span<const uint32_t> words, std::span<const uint32_t> made)
{
    std::string error;
    if (made.empty() || words[3] >= kFewerThanAllIds || !spirv::Module::parse(words, error))
        return;
    const auto module = spirv::Module::parse(made, error);
    if (!module)
        std::fprintf(stderr, "made: %s\n", error.c_str());
    FUZZ_CHECK(module);
}

void checkTranslation(std::span<const uint32_t> words)
{
    const spirv::TranslateResult result = spirv::translateToExt(words);
    checkMade(words, result.words);
    FUZZ_CHECK(result.words.empty() || spirv::translateToExt(result.words).words.empty());
}

void checkMode(std::span<const uint32_t> words, const fuzz::SpirvInput &input)
{
    using To = spirv::ModeEdit::To;
    std::string error;
    const bool reads = spirv::readEntryPoints(words, error).has_value();
    FUZZ_CHECK(reads == error.empty());
    for (const spirv::ModeEdit &edit :
         {spirv::ModeEdit{.to = To::Always, .entryPoints = {}},
          spirv::ModeEdit{.to = To::Specialized, .constantId = 3, .initial = true, .entryPoints = {}},
          spirv::ModeEdit{.to = To::Always, .entryPoints = {input.entryPoint}},
          spirv::ModeEdit{.to = To::Absent, .entryPoints = {}}}) {
        const spirv::ModeResult result = spirv::editMicromapMode(words, edit);
        FUZZ_CHECK(result.words.empty() || (result.error.empty() && reads));
        checkMade(words, result.words);
        if (!result.words.empty())
            FUZZ_CHECK(spirv::readEntryPoints(result.words, error));
    }
}

void checkSites(std::span<const uint32_t> words, const fuzz::SpirvInput &input)
{
    const spirv::StageName stage{input.entryPoint, input.model};
    const std::vector<spirv::TraceSite> sites = spirv::traceSites(words, stage);
    FUZZ_CHECK(sites == spirv::traceSites(words, stage));
    std::vector<uint32_t> marks(sites.size(), 5);
    if (marks.size() > 1)
        marks[1] = UINT32_MAX;
    const std::vector<uint32_t> marked = spirv::markTraces(words, stage, 0x123456789000, marks);
    checkMade(words, marked);
    if (!marked.empty() && words[3] < kFewerThanAllIds)
        FUZZ_CHECK(spirv::traceSites(marked, stage).size() == sites.size());
}

void checkPayloads(std::span<const uint32_t> words, const fuzz::SpirvInput &input)
{
    spirv::PayloadTypes types;
    types.add(words, input.entryPoint, input.model);
    std::string error;
    auto module = spirv::Module::parse(words, error);
    if (!module || types.common().empty())
        return;
    spirv::Types known(*module);
    FUZZ_CHECK(spirv::makeType(*module, known, types.common()) != 0);
    checkMade(words, module->serialize());
}

void checkRewriting(std::span<const uint32_t> words, const spirv::RewriteOptions &options)
{
    const spirv::RewriteResult result = spirv::rewrite(words, options);
    FUZZ_CHECK(result.error.empty() == (result.status != Status::Failed));
    FUZZ_CHECK(result.words.empty() == (result.status != Status::Rewritten));

    const spirv::ModuleScan scan = spirv::scan(words);
    FUZZ_CHECK(scan.tracesRays || !scan.hasStages);
    if (options.pipelineStage)
        FUZZ_CHECK(result.status != Status::Unchanged);
    else if (!scan.tracesRays)
        FUZZ_CHECK(result.status == Status::Unchanged);

    const spirv::TracedFlags &traced = scan.traced;
    FUZZ_CHECK((traced.constant & ~traced.fixed) == 0 && (traced.traces || traced.fixed == spirv::TracedFlags{}.fixed));

    const spirv::RewriteResult again = spirv::rewrite(words, options);
    FUZZ_CHECK(again.status == result.status && again.words == result.words && again.error == result.error);

    if (result.status == Status::Rewritten && words[3] < kFewerThanAllIds) {
        std::string error;
        const auto module = spirv::Module::parse(result.words, error);
        if (!module)
            std::fprintf(stderr, "rewritten: %s\n", error.c_str());
        FUZZ_CHECK(module);
        FUZZ_CHECK(!module->hasCapability(5381)); // OpacityMicromapKHR
        FUZZ_CHECK(module->serialize() == result.words);
    }
}

} // namespace

extern "C" int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size)
{
    // On the heap, without a byte to spare, so that AddressSanitizer sees the end.
    const size_t count = size / 4;
    const auto words = std::make_unique<uint32_t[]>(count);
    if (count > 0)
        std::memcpy(words.get(), data, count * 4);
    const std::span<const uint32_t> view(words.get(), count);
    fuzz::SpirvInput input;
    fuzz::readOptions(view, input);
    checkRewriting(view, input.options);
    checkTranslation(view);
    checkMode(view, input);
    checkSites(view, input);
    checkPayloads(view, input);
    FUZZ_CHECK(!spirv::forcesTwoStatesWithoutCapability(view) || spirv::isSpirv(view));
    return 0;
}
