// SPDX-License-Identifier: Apache-2.0
// Unusual environments: no HOME, folders that do not exist or cannot be written to, misspelled settings. The layer
// works in all of them.
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <memory>
#include <optional>

#include <gtest/gtest.h>
#include <unistd.h>

#include "gpu/scene.h"
#include "gpu/tracer.h"
#include "harness/harness.h"

using namespace vt;

namespace
{

namespace fs = std::filesystem;

// Sets a variable, or removes it, and puts it back.
class Variable
{
public:
    Variable(const char *name, const char *value) : name_(name)
    {
        if (const char *old = std::getenv(name))
            old_ = old;
        set(value);
    }
    Variable(const Variable &) = delete;
    Variable &operator=(const Variable &) = delete;
    ~Variable() { set(old_ ? old_->c_str() : nullptr); }

private:
    void set(const char *value) const
    {
        if (value != nullptr)
            setenv(name_, value, 1);
        else
            unsetenv(name_);
    }
    const char *name_;
    std::optional<std::string> old_;
};

class Environments : public testing::Test
{
protected:
    Environments() { fs::create_directories(folder_); }
    ~Environments() override { fs::remove_all(folder_); }

    // A device and a ray that a micromap lets pass, with these variables; null: not set. The messages that come.
    static std::vector<Message> traceWith(std::span<const std::pair<const char *, const char *>> variables)
    {
        std::vector<std::unique_ptr<Variable>> set;
        for (const auto &[name, value] : variables)
            set.push_back(std::make_unique<Variable>(name, value));
        Gpu gpu({.validation = false});
        MicromapInput input;
        input.add(3, kFourState, std::vector<uint8_t>(64, 0));
        Micromap micromap(gpu, std::move(input));
        micromap.build();
        Geometry geometry{.vertices = triangleRow(1)};
        geometry.micromap = Attachment{&micromap};
        const Blas blas(gpu, {geometry});
        const Tlas tlas(gpu, {instance(blas, {}, 5)});
        Ray ray;
        ray.origin = {0.3f, 0.3f, 1};
        Tracer tracer(gpu);
        const Result result = tracer.trace(tlas, std::span(&ray, 1))[0];
        EXPECT_EQ(result.committed, kNone);
        EXPECT_EQ(result.candidateCount, 0u);
        return gpu.takeMessages();
    }
    static std::vector<Message> traceWith(std::initializer_list<std::pair<const char *, const char *>> variables)
    {
        return traceWith(std::span(variables.begin(), variables.size()));
    }

    fs::path folder_ = fs::temp_directory_path() / ("vellum-environment-" + std::to_string(getpid()));
};

constexpr const char *kAbsent = nullptr;

// True if all messages are about settings.
bool areOfSettings(const std::vector<Message> &messages)
{
    return std::ranges::all_of(messages, [](const Message &m) { return m.id == "VELLUM-setting"; });
}

TEST_F(Environments, WithoutHome)
{
    for (const char *home : {kAbsent, "", "relative", "/dev/null", "/proc", "/no/such/folder"}) {
        SCOPED_TRACE(testing::Message() << "HOME " << (home != nullptr ? home : "not set"));
        EXPECT_TRUE(traceWith({{"HOME", home}, {"XDG_CACHE_HOME", kAbsent}, {"XDG_DATA_HOME", kAbsent}}).empty());
    }
    for (const char *cache : {"", "relative", "/dev/null", "/proc/self"}) {
        SCOPED_TRACE(testing::Message() << "XDG_CACHE_HOME " << cache);
        EXPECT_TRUE(traceWith({{"HOME", kAbsent}, {"XDG_CACHE_HOME", cache}, {"XDG_DATA_HOME", cache}}).empty());
    }
    EXPECT_FALSE(fs::exists("relative"));
}

TEST_F(Environments, UnusableCacheFolders)
{
    std::ofstream(folder_ / "file") << "no folder";
    for (const fs::path &folder : {folder_ / "file", folder_ / "not" / "there", fs::path("/proc/self"), fs::path("")})
        EXPECT_TRUE(traceWith({{"VELLUM_CACHE_FOLDER", folder.c_str()}}).empty()) << folder;
}

TEST_F(Environments, UnusableDumpFolders)
{
    std::ofstream(folder_ / "file") << "no folder";
    for (const fs::path &folder : {folder_ / "file", folder_ / "not" / "there", fs::path("/proc/self")}) {
        SCOPED_TRACE(folder);
        const std::vector<Message> messages = traceWith({{"VELLUM_DUMP_SHADERS", folder.c_str()}});
        EXPECT_FALSE(messages.empty());
        for (const Message &m : messages) {
            EXPECT_EQ(m.id, "VELLUM-dump-shaders");
            EXPECT_NE(m.text.find(folder.string()), std::string::npos) << m.text;
        }
    }
}

TEST_F(Environments, UnusableSettingsFiles)
{
    std::ofstream(folder_ / "bytes", std::ios::binary) << std::string(100'000, '\xff') << "=\n= \0 =#\n"
                                                       << "vellum_opacity_micromap.\nvellum_opacity_micromap.=";
    for (const fs::path &file : {folder_, folder_ / "bytes", folder_ / "not there", fs::path("/dev/null")})
        EXPECT_TRUE(areOfSettings(traceWith({{"VK_LAYER_SETTINGS_PATH", file.c_str()}}))) << file;
}

TEST_F(Environments, WrongValuesOfSettings)
{
    for (const char *value : {"", "maybe", "-1", "99999999999999999999", "%s%n", " on"}) {
        SCOPED_TRACE(value);
        const std::vector<Message> messages = traceWith({{"VELLUM_REPORT", value},
                                                         {"VELLUM_VALIDATE", value},
                                                         {"VELLUM_STRICT", value},
                                                         {"VELLUM_ASSUME_MICROMAPS", value},
                                                         {"VELLUM_CONSTANT_RAY_FLAGS", value},
                                                         {"VELLUM_IMPLEMENTATION", value}});
        EXPECT_TRUE(areOfSettings(messages));
        EXPECT_EQ(messages.empty(), *value == 0);
    }
}

} // namespace
