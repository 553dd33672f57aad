// SPDX-License-Identifier: Apache-2.0
// Builds without Draco and meshoptimizer reject compressed geometry, and state which.
#include <gtest/gtest.h>

#include "gltf/data/decompress.h"
#include "gltf/file/gltf_error.h"

using namespace vellum;

TEST(GltfUncompressed, NamesTheMissingLibrary)
{
    EXPECT_FALSE(kDecompressesMeshes);
    const auto errorOf = [](const auto &function) -> std::string {
        try {
            function();
        } catch (const GltfUnsupported &error) {
            return error.what();
        }
        return "none";
    };
    const std::vector<uint8_t> bytes(64);
    EXPECT_EQ(errorOf([&] { DracoMesh(bytes, "mesh 0"); }),
              "mesh 0 is compressed by Draco, which this build cannot read");
    EXPECT_EQ(errorOf([&] { static_cast<void>(decompressView({}, bytes)); }),
              "is compressed by meshoptimizer, which this build cannot read");
}
