// SPDX-License-Identifier: Apache-2.0
// The location of the settings file on Windows: the registry before VK_LAYER_SETTINGS_PATH.
#include <filesystem>
#include <fstream>

#include <gtest/gtest.h>
#include <windows.h>

#include "core/utf8_path.h"
#include "layer/base/system.h"

namespace vellum::layer
{
namespace
{

constexpr const wchar_t *kKey = L"Software\\Khronos\\Vulkan\\Settings";

class RegisteredSettings : public testing::Test
{
protected:
    RegisteredSettings()
    {
        std::filesystem::create_directories(folder_);
        RegCreateKeyExW(HKEY_CURRENT_USER, kKey, 0, nullptr, 0, KEY_ALL_ACCESS, nullptr, &key_, nullptr);
        SetEnvironmentVariableW(L"VK_LAYER_SETTINGS_PATH", write(L"variable.txt").c_str());
    }
    ~RegisteredSettings() override
    {
        SetEnvironmentVariableW(L"VK_LAYER_SETTINGS_PATH", nullptr);
        RegCloseKey(key_);
        RegDeleteKeyW(HKEY_CURRENT_USER, kKey);
        std::filesystem::remove_all(folder_);
    }
    std::filesystem::path write(const std::wstring &name)
    {
        std::ofstream(folder_ / name) << "\n";
        return folder_ / name;
    }
    void enter(const std::filesystem::path &file, DWORD value)
    {
        RegSetValueExW(key_, file.c_str(), 0, REG_DWORD, reinterpret_cast<const BYTE *>(&value), sizeof value);
    }
    static std::string found()
    {
        return settingsFile([](const std::string &) {});
    }

    std::filesystem::path folder_ =
        std::filesystem::temp_directory_path() / (L"vellum settings \u5c4b " + std::to_wstring(GetCurrentProcessId()));
    HKEY key_ = nullptr;
};

TEST_F(RegisteredSettings, ComeBeforeTheVariable)
{
    EXPECT_EQ(found(), utf8Text(folder_ / "variable.txt"));
    const std::filesystem::path registered = write(L"registered.txt");
    enter(registered, 1); // turns it off
    enter(folder_ / L"gone.txt", 0);
    EXPECT_EQ(found(), utf8Text(folder_ / "variable.txt"));
    enter(registered, 0);
    EXPECT_EQ(found(), utf8Text(registered));
}

TEST(System, MemoryAtAnAddress)
{
    void *const wanted = reinterpret_cast<void *>(0x2f10'0000'0000);
    void *const got = mapMemoryAt(wanted, 1 << 20);
    ASSERT_EQ(got, wanted);
    EXPECT_EQ(static_cast<char *>(got)[(1 << 20) - 1], 0);
    EXPECT_EQ(mapMemoryAt(wanted, 65536), nullptr);
    unmapMemory(got, 1 << 20);
    EXPECT_EQ(mapMemoryAt(wanted, 65536), wanted);
    unmapMemory(wanted, 65536);
}

TEST(System, MessagesAreAppendedToFilesOnly)
{
    const std::filesystem::path file = std::filesystem::temp_directory_path() / L"vellum \u5c4b.log";
    std::filesystem::remove(file);
    EXPECT_TRUE(appendToFile(utf8Text(file), "one\n"));
    EXPECT_TRUE(appendToFile(utf8Text(file), "two\n"));
    EXPECT_EQ(std::filesystem::file_size(file), 8u);
    std::filesystem::remove(file);
    EXPECT_FALSE(appendToFile("NUL", "one\n"));
    EXPECT_FALSE(appendToFile(utf8Text(std::filesystem::temp_directory_path()), "one\n"));
}

} // namespace
} // namespace vellum::layer
