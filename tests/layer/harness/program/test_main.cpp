// SPDX-License-Identifier: Apache-2.0
// The tests' main: lets the loader find the layer of this build tree, and pins the driver, whatever the environment
// says. Most of what the tests cost is lavapipe compiling shaders, so it also sees to it that lavapipe compiles each
// only once, and does not optimize.
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <string>

#include <gtest/gtest.h>

#include "check/oracle/outcome.h"
#include "harness/mock_driver.h"
#include "harness/program/labels.h"
#include "harness/program/process.h"

namespace
{

// Folders where the loader looks for layers. VELLUM_TEST_LAYER names the folder of another build of Vellum's layer,
// such as a mutant (bench/mutants), that replaces this build's.
std::string layerFolders()
{
    const char *other = std::getenv("VELLUM_TEST_LAYER");
    return std::string(other ? other : VELLUM_TEST_LAYER_FOLDER) + vt::kListSeparator + VELLUM_TEST_LAYERS_BELOW;
}

} // namespace

int main(int argc, char **argv)
{
    if (argc == 2 && std::strcmp(argv[1], "--labels") == 0) {
        for (const vt::Labelled &row : vt::Labels::all())
            std::printf("%s %s\n", row.cases.c_str(), row.labels.c_str());
        return 0;
    }
    vt::prepareProcess(argv, layerFolders());
    // VK_LAYER_PATH would hide VK_ADD_LAYER_PATH; implicit layers of this machine are not under test.
    unsetenv("VK_LAYER_PATH");
    unsetenv("VK_INSTANCE_LAYERS");
    setenv("VK_ADD_LAYER_PATH", layerFolders().c_str(), 1);
    setenv("VK_LOADER_LAYERS_DISABLE", "~implicit~", 1);
#ifdef VELLUM_TEST_ICD
    // Lavapipe, unless the environment names another driver's manifest (docs/conformance.md).
    const char *driver = std::getenv("VELLUM_TEST_DRIVER");
    setenv("VK_DRIVER_FILES", driver ? driver : VELLUM_TEST_ICD, 1);
    setenv("VK_ICD_FILENAMES", driver ? driver : VELLUM_TEST_ICD, 1);
#endif
    vellum::check::oracle::everyTriangleHasMicromap = std::getenv("VELLUM_FORCING") != nullptr;
    setenv("GALLIVM_PERF", "nopt", 0);
    setenv("MESA_SHADER_CACHE_DIR", VELLUM_TEST_SHADER_CACHE, 0);
    testing::InitGoogleTest(&argc, argv);
    return RUN_ALL_TESTS();
}
