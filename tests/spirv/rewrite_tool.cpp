// SPDX-License-Identifier: Apache-2.0
// vellum_spirv_rewrite IN.spv OUT.spv [STAGE]: rewrites a module from the shell, as the layer would before the driver
// gets it. With STAGE, the entry point "main" as that stage of a ray tracing pipeline that uses micromaps.
#include "module_file.h"
#include "spirv/module/opcodes.h"
#include "spirv/rewrite.h"

#include <cstdio>
#include <exception>
#include <fstream>
#include <map>
#include <stdexcept>
#include <string>

namespace
{

using namespace vellum;

const std::map<std::string, spirv::PipelineStage> kStages = {
    {"raygen", {"main", spv::ExecutionModelRayGenerationKHR, spirv::Prologue::None, {}}},
    {"any-hit", {"main", spv::ExecutionModelAnyHitKHR, spirv::Prologue::TriangleHits, {}}},
    {"any-hit-box", {"main", spv::ExecutionModelAnyHitKHR, spirv::Prologue::BoxHits, {}}},
    {"intersection", {"main", spv::ExecutionModelIntersectionKHR, spirv::Prologue::BoxCulling, {}}},
    {"closest-hit", {"main", spv::ExecutionModelClosestHitKHR, spirv::Prologue::None, {}}},
    {"miss", {"main", spv::ExecutionModelMissKHR, spirv::Prologue::None, {}}},
};

void rewriteFile(const char *input, const char *output, const char *stage)
{
    // Addresses of no memory: the result can be read and validated, and runs in tests/spirv/machine.h.
    spirv::RewriteOptions options{.rootAddress = 0x1000, .firstSlots = 0x2000};
    if (stage)
        options.pipelineStage = kStages.at(stage);
    const spirv::RewriteResult result = spirv::rewrite(test::readModule(input), options);
    if (result.status == spirv::RewriteResult::Status::Failed)
        throw std::runtime_error(result.error);
    if (result.status == spirv::RewriteResult::Status::Unchanged)
        throw std::runtime_error("the module needs no change");
    std::ofstream file(output, std::ios::binary);
    file.write(reinterpret_cast<const char *>(result.words.data()),
               static_cast<std::streamsize>(result.words.size() * sizeof(uint32_t)));
    if (!file.flush())
        throw std::runtime_error(std::string("cannot write ") + output);
}

} // namespace

int main(int argc, char **argv)
try {
    if (argc < 3 || argc > 4 || (argc == 4 && !kStages.contains(argv[3]))) {
        std::fprintf(stderr, "usage: vellum_spirv_rewrite IN.spv OUT.spv [STAGE]\nstages:");
        for (const auto &[name, stage] : kStages)
            std::fprintf(stderr, " %s", name.c_str());
        std::fprintf(stderr, "\n");
        return 2;
    }
    rewriteFile(argv[1], argv[2], argc == 4 ? argv[3] : nullptr);
    return 0;
} catch (const std::exception &error) {
    std::fprintf(stderr, "vellum_spirv_rewrite: %s\n", error.what());
    return 1;
}
