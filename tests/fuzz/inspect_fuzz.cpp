// SPDX-License-Identifier: Apache-2.0
// Fuzz target of what is done with a glTF file that can be read: baking, verifying, and the page and the picture of
// `vellum inspect`. The first byte says what the rest is, as in gltf_fuzz.cpp.
#include "base/error.h"
#include "gltf/file/gltf_error.h"
#include "gltf_input.h"
#include "inspect/page.h"
#include "inspect/uv_picture.h"
#include "verify/file.h"

using namespace vellum;
using namespace vellum::test;

namespace
{

void inspectDocument(const Document &document, const DocumentBakeOptions *bake)
{
    try {
        const inspect::InspectedFile file = inspect::inspectFile(document, {}, bake);
        const inspect::PageLimits limits{.stateBytes = 4096, .triangles = 1000, .thumbnails = 2, .textureEdge = 16};
        FUZZ_CHECK(!inspect::makePage(document, file, limits).empty());
        FUZZ_CHECK(inspect::drawUvSpace(file, {.edge = 64, .whole = false}).picture.width != 0);
    } catch (const Error &) {
        // nothing to look at
    }
}

// A baked micromap verifies without errors.
void verifyBaked(const Document &document)
{
    verify::FileOptions options;
    options.threads = 1;
    options.fileWork = uint64_t{1} << 18;
    options.workForByte = 16;
    static_cast<void>(verify::verifyDocument(document, options));
}

} // namespace

extern "C" int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size)
{
    if (size == 0)
        return 0;
    const Bytes copy(data + 1, data + size);
    const MemoryFile file(data[0] % 3 == 0 ? copy : data[0] % 3 == 1 ? glbOf(copy) : glbOf(repeated(copy)));
    try {
        const Document document(file.path());
        verifyBaked(document);
        inspectDocument(document, nullptr);
        DocumentBakeOptions bake;
        bake.bake.maxLevel = 2;
        bake.bake.threads = 1;
        bake.blend = true;
        inspectDocument(document, &bake);
    } catch (const GltfError &error) {
        FUZZ_CHECK(std::string_view(error.what()).starts_with(file.path().string() + ": "));
    } catch (const BakeError &) {
        // too large, for example
    }
    return 0;
}
