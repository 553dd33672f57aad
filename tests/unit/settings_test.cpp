// Settings come from a file, a structure in the instance's chain, and the environment, each stronger than those before.
#include "layer/ground/settings.h"

#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <tuple>

#include <gtest/gtest.h>
#include <unistd.h>

#include "layer/ground/report.h"
#include "layer/ground/vulkan_newer.h"

namespace vellum::layer
{
namespace
{

class SettingsTest : public testing::Test
{
protected:
    SettingsTest()
    {
        setenv("VK_LAYER_SETTINGS_PATH", file_.c_str(), 1);
        unsetenv("VELLUM_STRICT");
    }
    ~SettingsTest() override
    {
        unsetenv("VK_LAYER_SETTINGS_PATH");
        unsetenv("VELLUM_STRICT");
        std::filesystem::remove(file_);
    }
    void write(const char *line) { std::ofstream(file_) << "# a comment\n" << line << "\n"; }

    std::filesystem::path file_ =
        std::filesystem::path(testing::TempDir()) / ("vellum_settings_" + std::to_string(getpid()) + ".txt");
};

TEST_F(SettingsTest, ConstantRayFlagsAreUsedUnlessTurnedOff)
{
    const auto read = [] { return readSettings(nullptr).constantRayFlags; };
    write("");
    EXPECT_TRUE(read());
    write("vellum_opacity_micromap.constant_ray_flags = false");
    EXPECT_FALSE(read());
    setenv("VELLUM_CONSTANT_RAY_FLAGS", "on", 1);
    EXPECT_TRUE(read());
    write("");
    setenv("VELLUM_CONSTANT_RAY_FLAGS", "off", 1);
    EXPECT_FALSE(read());
    unsetenv("VELLUM_CONSTANT_RAY_FLAGS");
}

TEST_F(SettingsTest, StrictInAllThreePlaces)
{
    EXPECT_FALSE(readSettings(nullptr).strict);
    write("vellum_opacity_micromap.strict = true # why");
    EXPECT_TRUE(readSettings(nullptr).strict);
    const VkBool32 no = VK_FALSE;
    const newer::LayerSetting setting{kLayerName, "strict", newer::kLayerSettingBool32, 1, &no};
    const newer::LayerSettingsCreateInfo chain{newer::kLayerSettingsCreateInfo, nullptr, 1, &setting};
    EXPECT_FALSE(readSettings(&chain).strict);
    setenv("VELLUM_STRICT", "1", 1);
    EXPECT_TRUE(readSettings(&chain).strict);
    setenv("VELLUM_STRICT", "0", 1);
    write("vellum_opacity_micromap.strict = 1");
    EXPECT_FALSE(readSettings(nullptr).strict);
}

// A misspelled value is not the setting's opposite: nothing changes, and the user can read why.
TEST_F(SettingsTest, WrongValuesAreReportedAndIgnored)
{
    for (const char *value : {"yes", "2", "ture", "o f f"}) {
        write(("vellum_opacity_micromap.constant_ray_flags = " + std::string(value)).c_str());
        setenv("VELLUM_STRICT", value, 1);
        testing::internal::CaptureStderr();
        const Settings settings = readSettings(nullptr);
        const std::string said = testing::internal::GetCapturedStderr();
        EXPECT_TRUE(settings.constantRayFlags) << value;
        EXPECT_FALSE(settings.strict) << value;
        EXPECT_NE(said.find("VELLUM-setting: constant_ray_flags is \"" + std::string(value) + "\""), std::string::npos)
            << said;
        EXPECT_NE(said.find("VELLUM-setting: strict is"), std::string::npos) << said;
    }
    unsetenv("VELLUM_STRICT");
    write("vellum_opacity_micromap.report = loud\nvellum_opacity_micromap.valdiate = 1");
    testing::internal::CaptureStderr();
    EXPECT_EQ(readSettings(nullptr).report, ReportLevel::None);
    const std::string said = testing::internal::GetCapturedStderr();
    EXPECT_NE(said.find("report is \"loud\""), std::string::npos) << said;
    EXPECT_NE(said.find("there is no setting valdiate"), std::string::npos) << said;
}

TEST_F(SettingsTest, CaseDoesNotMatter)
{
    write("vellum_opacity_micromap.strict = True\nvellum_opacity_micromap.report = Warning");
    testing::internal::CaptureStderr();
    EXPECT_TRUE(readSettings(nullptr).strict);
    EXPECT_EQ(readSettings(nullptr).report, ReportLevel::Warning);
    EXPECT_EQ(testing::internal::GetCapturedStderr(), "");
}

VKAPI_ATTR VkBool32 VKAPI_CALL remember(VkDebugUtilsMessageSeverityFlagBitsEXT, VkDebugUtilsMessageTypeFlagsEXT,
                                        const VkDebugUtilsMessengerCallbackDataEXT *data, void *texts)
{
    *static_cast<std::string *>(texts) += std::string(data->pMessageIdName) + ": " + data->pMessage + "\n";
    return VK_FALSE;
}

// The text says what becomes of a fault that does no harm.
TEST(ReporterTest, ToleratesUnlessStrict)
{
    std::string texts;
    VkDebugUtilsMessengerCreateInfoEXT info{VK_STRUCTURE_TYPE_DEBUG_UTILS_MESSENGER_CREATE_INFO_EXT};
    info.messageSeverity = VK_DEBUG_UTILS_MESSAGE_SEVERITY_ERROR_BIT_EXT;
    info.messageType = VK_DEBUG_UTILS_MESSAGE_TYPE_VALIDATION_BIT_EXT;
    info.pfnUserCallback = remember;
    info.pUserData = &texts;
    Reporter report;
    report.addMessenger(VK_NULL_HANDLE, info);
    Settings settings;
    report.apply(settings);
    EXPECT_TRUE(report.tolerates("VELLUM-a", "one"));
    settings.strict = true;
    report.apply(settings);
    EXPECT_FALSE(report.tolerates("VELLUM-a", "two"));
    EXPECT_EQ(texts, "VELLUM-a: one; the layer goes on\nVELLUM-a: two\n");
}

} // namespace
} // namespace vellum::layer
