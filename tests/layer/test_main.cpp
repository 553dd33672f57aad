// The tests' main: lets the loader find the layer of this build tree, and pins the driver, whatever the environment
// says.
#include <cstdlib>

#include <gtest/gtest.h>

#if defined(__SANITIZE_ADDRESS__)
// Blocks that libraries which are not ours leave behind. Lavapipe 25 leaks one for each vkCmdBindVertexBuffers2 with a
// size, for instance. Only a function that is visible replaces the sanitizer's.
extern "C" __attribute__((visibility("default"))) const char *__lsan_default_suppressions();
extern "C" const char *__lsan_default_suppressions()
{
    return "leak:libvulkan_lvp\nleak:libLLVM\nleak:libVkLayer_khronos_validation\nleak:libdrm\n";
}
#endif

int main(int argc, char **argv)
{
    // VK_LAYER_PATH would hide VK_ADD_LAYER_PATH; implicit layers of this machine are not under test.
    unsetenv("VK_LAYER_PATH");
    unsetenv("VK_INSTANCE_LAYERS");
    setenv("VK_ADD_LAYER_PATH", VELLUM_TEST_LAYER_PATH, 1);
    setenv("VK_LOADER_LAYERS_DISABLE", "~implicit~", 1);
#ifdef VELLUM_TEST_DRIVER
    setenv("VK_DRIVER_FILES", VELLUM_TEST_DRIVER, 1);
    setenv("VK_ICD_FILENAMES", VELLUM_TEST_DRIVER, 1);
#endif
    testing::InitGoogleTest(&argc, argv);
    return RUN_ALL_TESTS();
}
