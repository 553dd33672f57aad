// SPDX-License-Identifier: Apache-2.0
// Devices for the tests: an application's instance with Vellum's layer on top, the validation layer and a spy below it
// (nearer to the driver), and every message that the layers sent. What is made on a device is in src/gpu.
// With the environment variable VELLUM_TEST_VALIDATION=above the validation layer is between the tests and Vellum's
// layer, and checks the tests instead; this needs a validation layer that knows the extensions (1.4.360).
#pragma once

#include <cstdlib>

#include <gtest/gtest.h>

#include "check/oracle/outcome.h"
#include "gpu/device.h"

namespace vt
{

using namespace vellum::check;
using oracle::kBox;
using oracle::kNoMicromap;
using oracle::Outcome;
using oracle::outcomeOf;

// The extension that the tests use: the environment variable VELLUM_TEST_API is "ext" or "khr".
Api apiOfTests();

// The environment variable VELLUM_TEST_ARENA says "exact" or "end".
Memory memoryOfTests();

// The position of the validation layer relative to Vellum's: the environment variable VELLUM_TEST_VALIDATION.
enum class Validation { Below, Above };
Validation validationOfTests();

// True if the layer also rejects tolerated faults, by its own environment variable VELLUM_STRICT. Tests of wrong input
// run both ways.
inline bool strictTests()
{
    const char *value = std::getenv("VELLUM_STRICT");
    return value && std::strcmp(value, "1") == 0;
}

struct Options {
    bool vellum = true;
    bool validation = true;
    bool oldValidation = true; // also a validation layer older than VK_KHR_opacity_micromap
    bool spy = true;           // layers/spy.cpp: what must not reach the driver
    std::string quirks = {};   // of the mock driver (layers/quirks.cpp), with commas; and those of VELLUM_TEST_QUIRKS
    std::string fault = {};    // of the faulty driver (faulty_driver/faults.cpp), of which Vellum's layer is a part
    std::string absentGpu{};   // a GPU that its driver compiles for though it is not there (drivers/compiled.h)
    bool micromaps = true;     // enable opacity micromaps on the device
    Api api = apiOfTests();    // by this extension
    bool bothApis = false;     // enable the other one, too
    bool hostCommands = true;  // enable micromapHostCommands
    bool fewFeatures = false;  // vellum::gpu::DeviceOptions::fewFeatures
    bool validate = false;     // the layer's setting
    bool shaderObject = false; // VK_EXT_shader_object, which the oldest supported headers do not know
    bool debugMarker = false;  // VK_EXT_debug_marker, where a layer offers it
    bool maintenance = false;  // VK_KHR_ray_tracing_maintenance1
    bool newer = false; // extensions for ray tracing pipelines that the oldest supported headers do not know, and
                        // the validation layer of that age reports as errors: see oldValidation
    bool addressCommands = false; // VK_KHR_device_address_commands, and the extensions whose commands it has again
    bool nullIndexBuffer = false; // VK_KHR_maintenance6
    bool micromapFeature = true;  // where the extension is enabled, its feature too
    bool shared = false;          // by all tests of the process that request the same
    bool addressReplay = true;    // enable bufferDeviceAddressCaptureReplay, where it is there
    Memory memory = memoryOfTests();
    bool declaresMode = true; // with Api::Khr: modules of ray queries have the execution mode, and so use micromaps

    bool operator==(const Options &) const = default;
};

// The messages of a device that a test has not taken yet.
class Messages
{
public:
    Messages() = default;
    Messages(const Messages &) = delete;
    Messages &operator=(const Messages &) = delete;
    // Reports those that no test expects: what is left alive is reported by layers when its device goes.
    ~Messages();

    // All messages since the last call.
    std::vector<Message> takeMessages();
    // Messages that no test expects: those not on the short list of false alarms in harness.cpp. If Vellum reports an
    // error, the test caused it, and messages of a validation layer above are about the same.
    std::vector<Message> takeUnexpectedMessages();
    // The test breaks the rule with this VUID: a validation layer above may say so.
    void breaks(std::string rule) { broken_.push_back(std::move(rule)); }
    // The number of warnings that an intersection shader does not see all ray flags. They are not kept as messages.
    [[nodiscard]] size_t intersectionWarnings() const { return intersectionWarnings_; }

protected:
    void add(Message message);
    void forget();

private:
    std::mutex mutex_; // layers speak on whichever thread calls them
    std::vector<Message> messages_;
    std::vector<std::string> broken_;
    std::atomic<size_t> intersectionWarnings_ = 0;
};

class LayerEnvironment; // variables that layers read when an instance is created

class Gpu : public Messages, public Device
{
public:
    explicit Gpu(const Options &options = {});

    [[nodiscard]] const Options &options() const { return options_; }
    // Restores the initial state for the next test: forgets changes by use() and breaks().
    void reset(const Options &options);

private:
    Gpu(const Options &options, const LayerEnvironment &);

    Options options_;
};

// A test with a device; at its end no error may have been reported. Where the device is shared, what a test left
// alive is reported when the process ends; run_cases.py then runs the tests one by one to find out which it was.
class GpuTest : public testing::Test
{
protected:
    explicit GpuTest(const Options &options = {});
    ~GpuTest() override;
    void TearDown() override;

    void expectNoMessages()
    {
        for (const Message &m : gpu_->takeUnexpectedMessages())
            ADD_FAILURE() << m.id << ": " << m.text;
    }
    Gpu &gpu() { return *gpu_; }

private:
    std::shared_ptr<Gpu> gpu_;
};

// A test with a device that has ray tracing pipelines, where there is one.
class PipelineTest : public GpuTest
{
protected:
    explicit PipelineTest(const Options &options = {}) : GpuTest(options) {}
    void SetUp() override
    {
        if (!gpu().has(VK_KHR_RAY_TRACING_PIPELINE_EXTENSION_NAME))
            GTEST_SKIP() << "no ray tracing pipelines";
    }
};

// Throws what the test then reports.
inline void check(VkResult result, const char *what)
{
    checkResult(result, what);
}
#define VT_CHECK(call) ::vt::check((call), #call)

} // namespace vt
