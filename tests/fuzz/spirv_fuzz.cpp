// SPDX-License-Identifier: Apache-2.0
// Fuzz target of the SPIR-V rewriter: whatever the words are, rewrite() reads nothing outside them, ends soon, and says
// the same each time; what it calls Rewritten is a module.
#include <cstring>
#include <memory>

#include "check.h"
#include "spirv/module/module.h"
#include "spirv_input.h"

using namespace vellum;

namespace
{

using Status = spirv::RewriteResult::Status;

// The universal limit of ids (SPIR-V specification, 2.17), less than what the rewriter may need for its own.
constexpr uint32_t kFewerThanAllIds = 4'000'000;

void check(std::span<const uint32_t> words, const spirv::RewriteOptions &options)
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
    // On the heap, and no byte too many: so AddressSanitizer sees the end.
    const size_t count = size / 4;
    const auto words = std::make_unique<uint32_t[]>(count);
    if (count > 0)
        std::memcpy(words.get(), data, count * 4);
    const std::span<const uint32_t> view(words.get(), count);
    fuzz::SpirvInput input;
    fuzz::readOptions(view, input);
    check(view, input.options);
    return 0;
}
