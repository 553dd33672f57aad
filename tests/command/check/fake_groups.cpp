// SPDX-License-Identifier: Apache-2.0
// Groups and a device that stand for those of `vellum check`, and behave as badly as a driver may.
#include <algorithm>
#include <chrono>
#include <cstdio>
#include <cstdlib>
#include <filesystem>
#include <stdexcept>
#include <string>
#include <string_view>
#include <thread>

#include "base/error.h"
#include "check/case/case.h"
#include "check/groups/group.h"
#include "cli/check/cases.h"
#include "cli/check/worker.h"
#include "fake_system.h"

namespace vellum::check
{

class Session
{
public:
    ~Session()
    {
        if (crashesAtEnd)
            test::crash();
    }
    Session() = default;
    Session(const Session &) = delete;
    Session &operator=(const Session &) = delete;

    bool crashesAtEnd = false;
    bool worn = false;
};

namespace
{

std::string variable(const char *name)
{
    const char *value = std::getenv(name);
    return value != nullptr ? value : "";
}

Outcome pass(Session &, std::string_view, uint64_t)
{
    Outcome outcome;
    outcome.rays = 10;
    return outcome;
}

Outcome fail(Session &, std::string_view, uint64_t seed)
{
    Outcome outcome;
    outcome.status = Status::Fail;
    outcome.cause = "expected opaque, found \"transparent\" & <unknown>";
    outcome.detail = "seed " + hexadecimal(seed) + "\nsecond line";
    outcome.reproducer = R"({"triangles": 1})";
    outcome.rays = 3;
    outcome.files.push_back({"txt", "an account"});
    outcome.files.push_back({"png", std::string("\x89PNG\0\xff", 6)});
    return outcome;
}

Outcome skip(Session &, std::string_view, uint64_t)
{
    Outcome outcome;
    outcome.status = Status::Skip;
    outcome.cause = "the device has no pipelines";
    return outcome;
}

Outcome crash(Session &, std::string_view, uint64_t)
{
    std::fputs("\xff\x01 <&", stderr);
    test::crash();
    return {};
}

Outcome assertion(Session &, std::string_view, uint64_t)
{
    std::fputs("chatter\ndriver.c:12: draw: Assertion `\xff' failed.\n", stderr);
    std::abort();
}

Outcome hang(Session &, std::string_view, uint64_t)
{
    if (const std::string folder = variable("VELLUM_FAKE_FOLDER"); !folder.empty())
        std::filesystem::create_directory(folder + "/hangs");
    for (;;)
        std::this_thread::sleep_for(std::chrono::hours(1));
}

// The process that started this one can start no other any more.
Outcome useUp(Session &, std::string_view, uint64_t)
{
    test::letParentStartNothing();
    return {};
}

Outcome useUpAndCrash(Session &, std::string_view, uint64_t)
{
    test::letParentStartNothing();
    test::crash();
    return {};
}

// Leaves a process behind that keeps everything open.
Outcome hangTwice(Session &session, std::string_view group, uint64_t seed)
{
    test::leaveProcessBehind();
    return hang(session, group, seed);
}

Outcome lose(Session &, std::string_view, uint64_t)
{
    Outcome outcome;
    outcome.status = Status::DeviceLost;
    outcome.cause = "vkQueueSubmit";
    return outcome;
}

Outcome exitEarly(Session &, std::string_view, uint64_t)
{
    std::_Exit(0);
}

Outcome throwError(Session &, std::string_view, uint64_t)
{
    throw std::runtime_error("no memory");
}

Outcome printJunk(Session &, std::string_view, uint64_t)
{
    std::printf("{\"event\":\"end\",\"status\":\"Fail\"}\n%s", std::string(300000, 'x').c_str());
    std::fflush(stdout);
    std::fputs("{\"event\":\"error\",\"message\":\"junk\"}\n", stderr);
    return {};
}

Outcome writeEvents(Session &, std::string_view, uint64_t)
{
    return test::writeWhereEventsGo("junk\n{}\n") ? Outcome() : throw std::runtime_error("no descriptor");
}

// Fails the first time only.
Outcome flake(Session &session, std::string_view group, uint64_t seed)
{
    const std::string mark = variable("VELLUM_FAKE_FOLDER") + "/" + hexadecimal(seed);
    const bool first = std::filesystem::create_directory(mark);
    return first ? fail(session, group, seed) : pass(session, group, seed);
}

Outcome crashSometimes(Session &session, std::string_view group, uint64_t seed)
{
    return seed % 3 == 0 ? crash(session, group, seed) : pass(session, group, seed);
}

Outcome crashAtEnd(Session &session, std::string_view, uint64_t)
{
    session.crashesAtEnd = true;
    return {};
}

constexpr uint32_t kWornKinds = 10;

// Case 4 leaves something behind that ends case 7 of the same process.
Outcome wearOut(Session &session, std::string_view group, uint64_t seed)
{
    session.worn |= seed % kWornKinds == 4;
    if (!session.worn || seed % kWornKinds != 7)
        return pass(session, group, seed);
    return variable("VELLUM_FAKE_WORN") == "hang" ? hang(session, group, seed) : crash(session, group, seed);
}

// Crashes the first time only.
Outcome crashOnce(Session &session, std::string_view group, uint64_t seed)
{
    const std::string mark = variable("VELLUM_FAKE_FOLDER") + "/" + hexadecimal(seed);
    return std::filesystem::create_directory(mark) ? crash(session, group, seed) : pass(session, group, seed);
}

constexpr Group kGroups[] = {
    {"good", "Passes", "Section 1", 5, pass, 3},
    {"bad", "Fails", "Section 2", 5, fail},
    {"used-up", "Uses up what processes need", "", 1, useUp},
    {"used-up-crash", "The same, and crashes", "", 1, useUpAndCrash},
    {"skip", "Skips", "Section 3", 2, skip},
    {"crash", "Crashes", "", 2, crash},
    {"assertion", "Aborts", "", 1, assertion},
    {"hang", "Hangs", "", 1, hang},
    {"hang-twice", "Hangs with another process", "", 1, hangTwice},
    {"lost", "Loses the device", "", 2, lose},
    {"exit", "Ends the process", "", 1, exitEarly},
    {"throw", "Throws", "", 1, throwError},
    {"junk", "Prints", "", 3, printJunk, 1},
    {"events", "Writes what is no event", "", 2, writeEvents},
    {"flake", "Fails once", "", 2, flake},
    {"sometimes", "Crashes sometimes", "", 30, crashSometimes}, // the usual number of quick cases
    {"end", "Crashes when the device is closed", "", 3, crashAtEnd},
    {"worn", "Crashes after another case", "", kWornKinds, wearOut, kWornKinds, kWornKinds},
    {"crash-once", "Crashes once", "", 3, crashOnce},
};

} // namespace

std::span<const Group> groups()
{
    return kGroups;
}

std::shared_ptr<Session> openSession(const SessionOptions &options)
{
    if (options.device != 7)
        throw std::runtime_error("another device than the one that was chosen");
    const std::string behaviour = variable("VELLUM_FAKE_OPEN");
    if (behaviour == "throw")
        throw std::runtime_error("no device today");
    if (behaviour == "crash")
        test::crash();
    auto session = std::make_shared<Session>();
    if (behaviour == "hang")
        hang(*session, {}, 0);
    return session;
}

// Makes cases of twelve triangles, which do what the group does if they have three or more.
std::string makeCase(Session &, const Group &group, uint64_t seed)
{
    Case c{.group = std::string(group.name), .seed = seed};
    oracle::Mesh mesh;
    for (uint32_t i = 0; i < 12; ++i) { // no run of a case file
        const auto x = static_cast<float>(i * i);
        for (const Vec3 &vertex : {Vec3{x, 0, 0}, Vec3{x + 1, 0, 0}, Vec3{x, 1, 0}})
            mesh.vertices.push_back(vertex);
    }
    c.scene.objects = {{.meshes = {mesh}}};
    c.scene.instances = {{.transform = {{{1, 0, 0, 0}, {0, 1, 0, 0}, {0, 0, 1, 0}}}}};
    c.scene.rays = {{.origin = {0.25f, 0.25f, 1}, .direction = {0, 0, -1}}};
    return toJson(c);
}

Outcome replay(Session &session, const std::string &reproducer)
{
    if (reproducer.find("scene") != std::string::npos) {
        const Case c = caseFromJson(reproducer);
        const auto group = std::ranges::find(kGroups, c.group, &Group::name);
        return c.scene.objects[0].meshes[0].vertices.size() < 9 ? Outcome() : group->run(session, c.group, c.seed);
    }
    Outcome outcome;
    outcome.status = reproducer.find("good") == std::string::npos ? Status::Fail : Status::Pass;
    outcome.cause = "replayed " + reproducer;
    return outcome;
}

} // namespace vellum::check

namespace vellum::cli
{

DeviceSummary describeDevice(const WorkerOptions &options)
{
    const std::string device = check::variable("VELLUM_FAKE_DEVICE");
    if (device == "none")
        throw Error("there is no Vulkan device");
    if (device == "crash")
        test::crash();
    if (device == "setting")
        std::fputs("chatter\nvellum: VELLUM-setting: there is no setting VELLUM_VALIDTE\nmore", stderr);
    std::string implementation = "fake";
    if (device == "layer")
        implementation = "emulated by the layer VK_LAYER_VELLUM_opacity_micromap";
    if (device == "variables") { // VELLUM in place of its layer, whose name would be that of the implementation
        implementation.clear();
        for (const char *name : {"VK_INSTANCE_LAYERS", "VK_LOADER_LAYERS_ENABLE", "VK_LOADER_LAYERS_DISABLE"})
            implementation += check::variable(name) + "|";
        constexpr std::string_view kLayer = "VK_LAYER_VELLUM_opacity_micromap";
        for (size_t at = 0; (at = implementation.find(kLayer)) != std::string::npos;)
            implementation.replace(at, kLayer.size(), "VELLUM");
    }
    return {7,
            options.device.text().value_or("fake"),
            implementation,
            device != "ext",
            device != "khr",
            {{"rays are <green>", "colours are not compared"}}};
}

} // namespace vellum::cli
