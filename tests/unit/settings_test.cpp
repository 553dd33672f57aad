// SPDX-License-Identifier: Apache-2.0
// Settings come from a file, a structure in the instance's chain, and the environment, each stronger than those before.
#include "layer/base/settings.h"
#include "layer/rules/rule.h"

#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <map>
#include <optional>
#include <tuple>

#include <gtest/gtest.h>
#include <unistd.h>

#include "layer/base/report.h"
#include "vk/newer.h"

namespace vellum::layer
{
namespace
{

std::filesystem::path program()
{
#ifdef _WIN32
    return _pgmptr;
#else
    return std::filesystem::read_symlink("/proc/self/exe");
#endif
}

// What ends each line on stderr and in files: the program and its process.
const std::string kProcess = " [" + program().filename().string() + " " + std::to_string(getpid()) + "]";

class SettingsTest : public testing::Test
{
protected:
    SettingsTest()
    {
        std::filesystem::create_directories(folder_);
        set("VK_LAYER_SETTINGS_PATH", file_.string().c_str());
        // Whatever settings this machine has.
        set("XDG_DATA_HOME", folder_.string().c_str());
        unsetenv("VELLUM_STRICT");
    }
    ~SettingsTest() override
    {
        unsetenv("VELLUM_STRICT");
        for (const auto &[name, value] : before_)
            value ? setenv(name.c_str(), value->c_str(), 1) : unsetenv(name.c_str());
        std::filesystem::remove_all(folder_);
    }
    void write(const char *line) { writeTo(file_, line); }
    static void writeTo(const std::filesystem::path &file, const char *line)
    {
        std::filesystem::create_directories(file.parent_path());
        std::ofstream(file) << "# a comment\n" << line << "\n";
    }
    // Set until the test ends.
    void set(const std::string &name, const char *value)
    {
        const char *now = getenv(name.c_str());
        before_.try_emplace(name, now ? std::optional<std::string>(now) : std::nullopt);
        value ? setenv(name.c_str(), value, 1) : unsetenv(name.c_str());
    }
    // The output of reading the settings.
    std::string printed(const void *chain = nullptr)
    {
        testing::internal::CaptureStderr();
        settings_ = readSettings(chain);
        Reporter().apply(settings_, nullptr);
        return testing::internal::GetCapturedStderr();
    }

    std::filesystem::path folder_ =
        std::filesystem::path(testing::TempDir()) / ("vellum_settings_" + std::to_string(getpid()));
    std::filesystem::path file_ = folder_ / "settings.txt";
    std::map<std::string, std::optional<std::string>> before_;
    Settings settings_;
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

TEST_F(SettingsTest, StrictFromEachSource)
{
    EXPECT_FALSE(readSettings(nullptr).strict);
    write("vellum_opacity_micromap.strict = true # why");
    EXPECT_TRUE(readSettings(nullptr).strict);
    const VkBool32 no = VK_FALSE;
    const VkLayerSettingEXT setting{kLayerName, "strict", VK_LAYER_SETTING_TYPE_BOOL32_EXT, 1, &no};
    const VkLayerSettingsCreateInfoEXT chain{VK_STRUCTURE_TYPE_LAYER_SETTINGS_CREATE_INFO_EXT, nullptr, 1, &setting};
    EXPECT_FALSE(readSettings(&chain).strict);
    setenv("VELLUM_STRICT", "1", 1);
    EXPECT_TRUE(readSettings(&chain).strict);
    setenv("VELLUM_STRICT", "0", 1);
    write("vellum_opacity_micromap.strict = 1");
    EXPECT_FALSE(readSettings(nullptr).strict);
}

// VK_EXT_layer_settings has a value for each, a file commas.
TEST_F(SettingsTest, SeveralValues)
{
    write("");
    const char *const values[]{"core", "sync"};
    const VkLayerSettingEXT setting{kLayerName, "validate", VK_LAYER_SETTING_TYPE_STRING_EXT, 2, values};
    const VkLayerSettingsCreateInfoEXT chain{VK_STRUCTURE_TYPE_LAYER_SETTINGS_CREATE_INFO_EXT, nullptr, 1, &setting};
    EXPECT_EQ(printed(&chain), "");
    const Checks expected{.core = true, .sync = true};
    EXPECT_EQ(settings_.validate, expected);
}

TEST_F(SettingsTest, VariablesWithVkBefore)
{
    write("");
    // The variable that Vulkan-Utility-Libraries derives from the layer's name.
    set("VK_VELLUM_OPACITY_MICROMAP_STRICT", "1");
    EXPECT_EQ(printed(), "");
    EXPECT_TRUE(settings_.strict);
    set("VK_VELLUM_STRICT", "0");
    EXPECT_FALSE(readSettings(nullptr).strict);
    set("VK_VELLUM_STRICT", "1");
    EXPECT_TRUE(readSettings(nullptr).strict);
    set("VELLUM_STRICT", "0");
    EXPECT_FALSE(readSettings(nullptr).strict);
}

TEST_F(SettingsTest, TheFirstFileThatThereIs)
{
    const std::filesystem::path users = folder_ / "vulkan/settings.d/vk_layer_settings.txt";
    set("VK_LAYER_SETTINGS_PATH", nullptr);
    EXPECT_FALSE(readSettings(nullptr).strict);
    // The file that Vulkan Configurator writes in the user's data folder.
    writeTo(users, "vellum_opacity_micromap.strict = true");
    EXPECT_TRUE(readSettings(nullptr).strict);
    set("XDG_DATA_HOME", nullptr);
    set("HOME", (folder_ / "home").string().c_str());
    EXPECT_FALSE(readSettings(nullptr).strict);
    writeTo(folder_ / "home/.local/share/vulkan/settings.d/vk_layer_settings.txt",
            "vellum_opacity_micromap.strict = true");
    EXPECT_TRUE(readSettings(nullptr).strict);
    // A folder, and what the user chose before what the user has.
    writeTo(folder_ / "chosen/vk_layer_settings.txt", "vellum_opacity_micromap.validate = true");
    set("VK_LAYER_SETTINGS_PATH", (folder_ / "chosen").string().c_str());
    EXPECT_FALSE(readSettings(nullptr).strict);
    EXPECT_EQ(readSettings(nullptr).validate, (Checks{true, true, true}));
}

TEST_F(SettingsTest, AllValues)
{
    for (const char *yes : {"1", "true", "TRUE", "True", "on", "yes"}) {
        write((std::string("vellum_opacity_micromap.strict = ") + yes).c_str());
        EXPECT_EQ(printed(), "") << yes;
        EXPECT_TRUE(settings_.strict) << yes;
    }
    set("VELLUM_STRICT", "1");
    for (const char *no : {"0", "false", "FALSE", "off", "no"}) {
        set("VELLUM_STRICT", no);
        EXPECT_EQ(printed(), "") << no;
        EXPECT_FALSE(settings_.strict) << no;
    }
    for (const auto &[name, level] :
         {std::pair{"error", ReportLevel::Error}, std::pair{"warning", ReportLevel::Warning},
          std::pair{"info", ReportLevel::Info}, std::pair{"none", ReportLevel::None}}) {
        set("VELLUM_REPORT", name);
        EXPECT_EQ(printed(), "") << name;
        EXPECT_EQ(settings_.report, level) << name;
    }
}

TEST_F(SettingsTest, AFileThatBeginsWithAByteOrderMark)
{
    std::ofstream(file_) << "\xef\xbb\xbfvellum_opacity_micromap.strict = true\r\n";
    EXPECT_TRUE(readSettings(nullptr).strict);
}

// The form in which Vulkan Configurator writes settings that have no value.
TEST_F(SettingsTest, EmptyValueInTheFile)
{
    set("XDG_CACHE_HOME", "/somewhere");
    set("LOCALAPPDATA", "/somewhere"); // on Windows
    write("vellum_opacity_micromap.cache_folder = ");
    EXPECT_EQ(std::filesystem::path(readSettings(nullptr).cacheFolder), std::filesystem::path("/somewhere") / "vellum");
    set("VELLUM_CACHE_FOLDER", "");
    EXPECT_EQ(readSettings(nullptr).cacheFolder, "");
}

TEST_F(SettingsTest, WrongNamesAreReportedOnce)
{
    write("vellum_opacity_micromap.strickt = true\nkhronos_validation.strickt = true");
    set("VK_VELLUM_OPACITY_MICROMAP_STRICKT", "1");
    set("VK_VELLUM_STRICKT", "1");
    set("VELLUM_STRICKT", "1");
    set("VELLUM_TEST_SOMETHING", "1"); // of the tests
    const VkLayerSettingEXT settings[]{{kLayerName, "stricter", VK_LAYER_SETTING_TYPE_BOOL32_EXT, 0, nullptr},
                                       {"VK_LAYER_other", "strictest", VK_LAYER_SETTING_TYPE_BOOL32_EXT, 0, nullptr}};
    const VkLayerSettingsCreateInfoEXT chain{VK_STRUCTURE_TYPE_LAYER_SETTINGS_CREATE_INFO_EXT, nullptr, 2, settings};
    const std::string head = "vellum: VELLUM-setting: there is no setting ";
    set("VELLUM_CACHE", "a variable of the command");
    const std::string tail = "; did you mean ";
    const std::string end = kProcess + "\n";
    EXPECT_EQ(printed(&chain), head + "strickt (" + file_.string() + ")" + tail + "strict?" + end + head +
                                   "stricter (VkLayerSettingEXT)" + tail + "strict?" + end + head +
                                   "VK_VELLUM_OPACITY_MICROMAP_STRICKT" + tail + "VK_VELLUM_OPACITY_MICROMAP_STRICT?" +
                                   end + head + "VK_VELLUM_STRICKT" + tail + "VK_VELLUM_STRICT?" + end + head +
                                   "VELLUM_STRICKT" + tail + "VELLUM_STRICT?" + end);
    EXPECT_EQ(printed(&chain), "");
    EXPECT_FALSE(settings_.strict);
}

TEST_F(SettingsTest, WrongValuesAreReportedOnceAndIgnored)
{
    write("vellum_opacity_micromap.strict = 1\nvellum_opacity_micromap.report = quiet");
    set("VELLUM_STRICT", "maybe");
    const VkBool32 yes = VK_TRUE;
    const VkLayerSettingEXT settings[]{{kLayerName, "dump_shaders", VK_LAYER_SETTING_TYPE_BOOL32_EXT, 1, &yes},
                                       {kLayerName, "validate", static_cast<VkLayerSettingTypeEXT>(99), 1, &yes}};
    const VkLayerSettingsCreateInfoEXT chain{VK_STRUCTURE_TYPE_LAYER_SETTINGS_CREATE_INFO_EXT, nullptr, 2, settings};
    const std::string head = "vellum: VELLUM-setting: ";
    const std::string tail = "; the setting is ignored" + kProcess + "\n";
    EXPECT_EQ(printed(&chain),
              head + "report is \"quiet\" (" + file_.string() + ") and must be error, warning, info or none" + tail +
                  head + "dump_shaders is of type 0 (VkLayerSettingEXT) and must be of type STRING" + tail + head +
                  "validate is of type 99 (VkLayerSettingEXT) and must be of type BOOL32 or STRING" + tail + head +
                  "strict is \"maybe\" (VELLUM_STRICT) and must be 1, true, on, yes, 0, false, off or no" + tail);
    EXPECT_TRUE(settings_.strict);
    EXPECT_EQ(settings_.dumpShaders, "");
    EXPECT_EQ(printed(&chain), "");
}

TEST_F(SettingsTest, FaultsAreAppendedToTheReportFile)
{
    write("");
    const std::filesystem::path report = folder_ / "report";
    set("VELLUM_REPORT_FILE", report.string().c_str());
    set("VELLUM_STRICT", "per\nhaps");
    EXPECT_NE(printed(), "");
    EXPECT_EQ(printed(), "");
    std::ifstream lines(report);
    const std::string text(std::istreambuf_iterator<char>(lines), {});
    EXPECT_EQ(text, "error VELLUM-setting: strict is \"per haps\" (VELLUM_STRICT) and must be 1, true, on, yes, 0, "
                    "false, off or no; the setting is ignored" +
                        kProcess + "\n");
}

TEST_F(SettingsTest, MissingFile)
{
    set("VK_LAYER_SETTINGS_PATH", (folder_ / "nowhere").string().c_str());
    EXPECT_EQ(printed(), "vellum: VELLUM-setting: VK_LAYER_SETTINGS_PATH is \"" + (folder_ / "nowhere").string() +
                             "\" and must be a file of settings, or a folder with one" + kProcess + "\n");
    EXPECT_EQ(printed(), "");
}

TEST_F(SettingsTest, SeveralStructures)
{
    write("");
    const VkBool32 yes = VK_TRUE;
    const VkLayerSettingEXT strict{kLayerName, "strict", VK_LAYER_SETTING_TYPE_BOOL32_EXT, 1, &yes};
    const VkLayerSettingEXT validate{kLayerName, "validate", VK_LAYER_SETTING_TYPE_BOOL32_EXT, 1, &yes};
    const VkLayerSettingsCreateInfoEXT second{VK_STRUCTURE_TYPE_LAYER_SETTINGS_CREATE_INFO_EXT, nullptr, 1, &validate};
    const VkLayerSettingsCreateInfoEXT first{VK_STRUCTURE_TYPE_LAYER_SETTINGS_CREATE_INFO_EXT, &second, 1, &strict};
    EXPECT_TRUE(readSettings(&first).strict);
    EXPECT_EQ(readSettings(&first).validate, (Checks{true, true, true}));
}

TEST_F(SettingsTest, StringsOfAProgram)
{
    write("");
    const char *const value = "core, sync";
    const auto type = static_cast<VkLayerSettingTypeEXT>(7); // VK_LAYER_SETTING_TYPE_STRING_EXT
    const VkLayerSettingEXT validate{kLayerName, "validate", type, 1, &value};
    const VkLayerSettingsCreateInfoEXT chain{VK_STRUCTURE_TYPE_LAYER_SETTINGS_CREATE_INFO_EXT, nullptr, 1, &validate};
    EXPECT_EQ(readSettings(&chain).validate, (Checks{.core = true, .sync = true}));
    EXPECT_EQ(printed(), "");
}

// Parts of validation, with commas.
TEST_F(SettingsTest, PartsOfValidation)
{
    const auto validated = [this](const char *value) {
        write(("vellum_opacity_micromap.validate = " + std::string(value)).c_str());
        return readSettings(nullptr).validate;
    };
    EXPECT_EQ(validated("core"), (Checks{.core = true}));
    EXPECT_EQ(validated("sync, GPU"), (Checks{.gpu = true, .sync = true}));
    EXPECT_EQ(validated("all"), (Checks{true, true, true}));
    EXPECT_EQ(validated("none"), Checks{});
    EXPECT_EQ(validated("off"), Checks{});
    EXPECT_EQ(validated("core,gpus"), Checks{}); // wrong as a whole
}

// A misspelled value is not the setting's opposite: nothing changes, and the user can read why.
TEST_F(SettingsTest, WrongValuesAreReportedAndIgnored)
{
    for (const char *value : {"yep", "2", "ture", "o f f"}) {
        write(("vellum_opacity_micromap.constant_ray_flags = " + std::string(value)).c_str());
        setenv("VELLUM_STRICT", value, 1);
        const std::string said = printed();
        const Settings &settings = settings_;
        EXPECT_TRUE(settings.constantRayFlags) << value;
        EXPECT_FALSE(settings.strict) << value;
        EXPECT_NE(said.find("VELLUM-setting: constant_ray_flags is \"" + std::string(value) + "\""), std::string::npos)
            << said;
        EXPECT_NE(said.find("VELLUM-setting: strict is"), std::string::npos) << said;
    }
    unsetenv("VELLUM_STRICT");
    write("vellum_opacity_micromap.report = loud\nvellum_opacity_micromap.valdiate = 1");
    const std::string said = printed();
    EXPECT_EQ(settings_.report, ReportLevel::None);
    EXPECT_NE(said.find("report is \"loud\""), std::string::npos) << said;
    EXPECT_NE(said.find("there is no setting valdiate"), std::string::npos) << said;
}

TEST_F(SettingsTest, SimulatedLevels)
{
    EXPECT_EQ(simulatedLimit(12, settings_.most2StateLevel), 12u);
    set("VELLUM_MAX_OPACITY_2_STATE_SUBDIVISION_LEVEL", "8");
    write("vellum_opacity_micromap.max_opacity_4_state_subdivision_level = 3");
    EXPECT_EQ(printed(), "");
    EXPECT_EQ(simulatedLimit(12, settings_.most2StateLevel), 8u);
    EXPECT_EQ(simulatedLimit(5, settings_.most2StateLevel), 5u);
    EXPECT_EQ(settings_.most4StateLevel, 3u);
    EXPECT_EQ(settings_.mostLossyLevel, 0u);
    set("VELLUM_MAX_OPACITY_LOSSY_4_STATE_SUBDIVISION_LEVEL", "2");
    EXPECT_EQ(printed(), "vellum: VELLUM-setting: max_opacity_lossy_4_state_subdivision_level is 2 "
                         "(VELLUM_MAX_OPACITY_LOSSY_4_STATE_SUBDIVISION_LEVEL) and must be at least 3, as on every "
                         "device; the setting is ignored" +
                             kProcess + "\n");
    EXPECT_EQ(settings_.mostLossyLevel, 0u);
}

TEST_F(SettingsTest, CaseDoesNotMatter)
{
    write("vellum_opacity_micromap.strict = True\nvellum_opacity_micromap.report = Warning");
    testing::internal::CaptureStderr();
    EXPECT_TRUE(readSettings(nullptr).strict);
    EXPECT_EQ(readSettings(nullptr).report, ReportLevel::Warning);
    EXPECT_EQ(testing::internal::GetCapturedStderr(), "");
}

VKAPI_ATTR VkBool32 VKAPI_CALL remember(VkDebugUtilsMessageSeverityFlagBitsEXT severity,
                                        VkDebugUtilsMessageTypeFlagsEXT,
                                        const VkDebugUtilsMessengerCallbackDataEXT *data, void *texts)
{
    const bool warning = severity == VK_DEBUG_UTILS_MESSAGE_SEVERITY_WARNING_BIT_EXT;
    *static_cast<std::string *>(texts) +=
        (warning ? "warning: " : "error: ") + std::string(data->pMessageIdName) + ": " + data->pMessage + "\n";
    return VK_FALSE;
}

// The text of a fault that does no harm states whether the layer goes on; the severity is an error with validation or
// `strict`.
TEST(ReporterTest, ToleratesUnlessStrict)
{
    std::string texts;
    VkDebugUtilsMessengerCreateInfoEXT info{VK_STRUCTURE_TYPE_DEBUG_UTILS_MESSENGER_CREATE_INFO_EXT};
    info.messageSeverity =
        VK_DEBUG_UTILS_MESSAGE_SEVERITY_ERROR_BIT_EXT | VK_DEBUG_UTILS_MESSAGE_SEVERITY_WARNING_BIT_EXT;
    info.messageType = VK_DEBUG_UTILS_MESSAGE_TYPE_VALIDATION_BIT_EXT;
    info.pfnUserCallback = remember;
    info.pUserData = &texts;
    Reporter report;
    report.addMessenger(VK_NULL_HANDLE, info);
    Driver driver;
    driver.reporter = &report;
    const AddressMap addresses;
    RuleDevice device{driver, addresses};
    device.ext = MicromapSupport{};
    const Place place("vkCommand");
    for (const bool validating : {false, true}) {
        device.validating = validating;
        texts.clear();
        Settings settings;
        report.apply(settings, nullptr);
        EXPECT_TRUE(InputCheck(device, place).report("VELLUM-a", nullptr, "one", Severity::Tolerate).accepted);
        settings.strict = true;
        report.apply(settings, nullptr);
        EXPECT_FALSE(InputCheck(device, place).report("VELLUM-a", nullptr, "two", Severity::Tolerate).accepted);
        EXPECT_EQ(texts,
                  (validating ? "error" : "warning") +
                      std::string(": VELLUM-a: vkCommand: one; the layer goes on\nerror: VELLUM-a: vkCommand: two\n"));
    }
}

// Faults of the settings go to the messengers of vkCreateInstance, or to the first one that is created after it, and to
// the file that a setting of any source names.
TEST_F(SettingsTest, FaultsReachMessengersAndTheFile)
{
    std::string texts;
    VkDebugUtilsMessengerCreateInfoEXT info{VK_STRUCTURE_TYPE_DEBUG_UTILS_MESSENGER_CREATE_INFO_EXT};
    info.messageSeverity = VK_DEBUG_UTILS_MESSAGE_SEVERITY_ERROR_BIT_EXT;
    info.messageType = VK_DEBUG_UTILS_MESSAGE_TYPE_VALIDATION_BIT_EXT;
    info.pfnUserCallback = remember;
    info.pUserData = &texts;
    const auto file = folder_ / "messages";
    write(("vellum_opacity_micromap.report_file = " + file.string() + "\nvellum_opacity_micromap.strict = loudly")
              .c_str());
    const std::string fault = "error: VELLUM-setting: strict is \"loudly\" (" + file_.string() +
                              ") and must be 1, true, on, yes, 0, false, off or no; the setting is ignored\n";
    testing::internal::CaptureStderr();
    const Settings settings = readSettings(nullptr);
    Reporter ofInstance;
    ofInstance.apply(settings, &info);
    EXPECT_EQ(texts, fault);
    ofInstance.addMessenger(VK_NULL_HANDLE, info);
    EXPECT_EQ(texts, fault);
    Reporter later;
    later.apply(settings, nullptr);
    EXPECT_EQ(texts, fault);
    later.addMessenger(VK_NULL_HANDLE, info);
    EXPECT_EQ(texts, fault + fault);
    later.addMessenger(VK_NULL_HANDLE, info);
    EXPECT_EQ(texts, fault + fault);
    const std::string line = fault.substr(7, fault.size() - 8) + kProcess;
    EXPECT_EQ("vellum: " + line + "\n", testing::internal::GetCapturedStderr());
    std::ifstream written(file);
    std::string found;
    std::getline(written, found);
    EXPECT_EQ(found, "error " + line);
}

// Whoever validates a program that has no messenger sees what is found.
TEST_F(SettingsTest, ValidationPrintsWithoutAMessenger)
{
    const auto prints = [this](const std::map<std::string, const char *> &variables, bool messenger = false) {
        for (const char *name : {"VELLUM_REPORT", "VELLUM_REPORT_FILE", "VELLUM_VALIDATE"})
            set(name, variables.contains(name) ? variables.at(name) : nullptr);
        Reporter report;
        report.apply(readSettings(nullptr), nullptr);
        std::string texts;
        VkDebugUtilsMessengerCreateInfoEXT info{VK_STRUCTURE_TYPE_DEBUG_UTILS_MESSENGER_CREATE_INFO_EXT};
        info.pfnUserCallback = remember;
        info.pUserData = &texts;
        if (messenger)
            report.addMessenger(VK_NULL_HANDLE, info);
        testing::internal::CaptureStderr();
        report.error("VELLUM-a", "one");
        report.warning("VELLUM-b", "two");
        report.info("VELLUM-c", "three");
        return testing::internal::GetCapturedStderr();
    };
    const std::string file = (folder_ / "messages").string();
    const std::string found = "vellum: VELLUM-a: one" + kProcess + "\nvellum: VELLUM-b: two" + kProcess + "\n";
    EXPECT_EQ(prints({}), "");
    EXPECT_EQ(prints({{"VELLUM_VALIDATE", "core"}}), found);
    EXPECT_EQ(prints({{"VELLUM_VALIDATE", "none"}}), "");
    EXPECT_EQ(prints({{"VELLUM_VALIDATE", "core"}}, true), "");
    EXPECT_EQ(prints({{"VELLUM_VALIDATE", "core"}, {"VELLUM_REPORT", "none"}}), "");
    EXPECT_EQ(prints({{"VELLUM_VALIDATE", "core"}, {"VELLUM_REPORT", "warning"}}, true), found);
    EXPECT_EQ(prints({{"VELLUM_VALIDATE", "core"}, {"VELLUM_REPORT_FILE", file.c_str()}}), "");
}

} // namespace
} // namespace vellum::layer
