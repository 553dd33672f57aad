// SPDX-License-Identifier: Apache-2.0
// What the layer keeps for the whole process is not on the heap: it would stay there when the layer is unloaded, and
// processes load it again and again. Each test has a process of its own, in which what is kept is made.
#include <cstdlib>

#include <gtest/gtest.h>

#include "allocations.h"
#include "layer/base/settings.h"
#include "layer/memory/kept_addresses.h"

namespace vellum::layer
{
namespace
{

TEST(Unloading, FilesOfAddresses)
{
    const long before = test::allocationsAlive;
    {
        KeptAddresses one, two;
        one.open("/nonexistent/folder/with/a/long/name/stem", {1, 2});
        two.open("/nonexistent/folder/with/a/long/name/stem", {1, 2});
    }
    EXPECT_EQ(test::allocationsAlive, before);
}

TEST(Unloading, FaultsOfSettings)
{
    setenv("VELLUM_STRICT", "a value that no boolean has", 1);
    testing::internal::CaptureStderr();
    const long before = test::allocationsAlive;
    static_cast<void>(readSettings(nullptr));
    static_cast<void>(readSettings(nullptr));
    EXPECT_EQ(test::allocationsAlive, before);
    const std::string printed = testing::internal::GetCapturedStderr();
    const size_t first = printed.find("a value that no boolean has");
    EXPECT_NE(first, std::string::npos);
    EXPECT_EQ(printed.find("a value that no boolean has", first + 1), std::string::npos) << "once";
    unsetenv("VELLUM_STRICT");
}

} // namespace
} // namespace vellum::layer
