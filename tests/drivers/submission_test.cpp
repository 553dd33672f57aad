// SPDX-License-Identifier: Apache-2.0
// Commands of the layer and of an application that a GPU's driver records and submits. They do nothing, as there is no
// GPU (kernel/absent_gpu.h): the driver must accept them, and the layer must work with a device that computes nothing.
#include "compiled.h"

#include <gtest/gtest.h>

#include "gpu/pipeline_tracer.h"
#include "harness/harness.h"

namespace vellum::test
{
namespace
{

struct GpuAndApi {
    const char *name;
    vt::Api api;
};

std::ostream &operator<<(std::ostream &out, const GpuAndApi &device)
{
    return out << device.name;
}

class Submission : public testing::TestWithParam<GpuAndApi>
{
};

TEST_P(Submission, BuildsAndTracesAreTaken)
{
    vt::Options options{.validation = false, .spy = false};
    options.api = GetParam().api;
    options.newer = true;
    if (const std::string whyNot = useGpu(GetParam().name, options); !whyNot.empty())
        GTEST_SKIP() << whyNot;
    vt::Gpu gpu(options);
    vt::MicromapInput input;
    const std::vector<uint8_t> states(16, 2);
    input.add(2, vt::kFourState, states);
    vt::Micromap micromap(gpu, input, VK_BUILD_MICROMAP_ALLOW_COMPACTION_BIT_EXT);
    micromap.build();
    vt::Geometry triangle;
    vt::appendTriangle(triangle.vertices, {});
    triangle.micromap = vt::Attachment{&micromap};
    vt::Geometry box;
    box.boxes = {{0, 0, 0, 1, 1, 1}};
    const vt::Blas triangles(gpu, {triangle}), boxes(gpu, {box});
    const vt::Tlas scene(gpu, {vt::instance(triangles, {}, 1), vt::instance(boxes, {2, 0, 0}, 2)});
    const std::vector<vt::Ray> rays(4);
    EXPECT_EQ(vt::Tracer(gpu).trace(scene, rays).size(), rays.size());
    const bool hasPipelines = gpu.has(VK_KHR_RAY_TRACING_PIPELINE_EXTENSION_NAME);
    ASSERT_EQ(hasPipelines, driverOf(GetParam().name) != Driver::Turnip);
    if (hasPipelines) {
        // An intersection shader that no group has would crash ANV, without the layer as well.
        vt::PipelineTracer tracer(gpu, {.groups = {{}, {.box = true}, {.box = true, .anyHit = false}}});
        EXPECT_EQ(tracer.trace(scene, rays).size(), rays.size());
    }
    for (const vt::Message &m : gpu.takeUnexpectedMessages())
        ADD_FAILURE() << m.id << ": " << m.text;
    EXPECT_EQ(gpu.intersectionWarnings() > 0, hasPipelines);
}

std::string nameOf(const testing::TestParamInfo<GpuAndApi> &info)
{
    return info.param.name + std::string(info.param.api == vt::Api::Khr ? "Khr" : "Ext");
}

INSTANTIATE_TEST_SUITE_P(Amd, Submission,
                         testing::Values(GpuAndApi{"navi21", vt::Api::Ext}, GpuAndApi{"navi21", vt::Api::Khr},
                                         GpuAndApi{"navi31", vt::Api::Khr}, GpuAndApi{"gfx1201", vt::Api::Ext}),
                         nameOf);
INSTANTIATE_TEST_SUITE_P(Intel, Submission,
                         testing::Values(GpuAndApi{"dg2", vt::Api::Ext}, GpuAndApi{"dg2", vt::Api::Khr},
                                         GpuAndApi{"mtl", vt::Api::Ext}, GpuAndApi{"lnl", vt::Api::Khr},
                                         GpuAndApi{"bmg", vt::Api::Ext}, GpuAndApi{"bmg", vt::Api::Khr}),
                         nameOf);
// a740 is excluded: turnip's own shaders need 8-bit storage, which it lacks there and warns about.
INSTANTIATE_TEST_SUITE_P(Qualcomm, Submission,
                         testing::Values(GpuAndApi{"a750", vt::Api::Ext}, GpuAndApi{"a750", vt::Api::Khr}), nameOf);

} // namespace
} // namespace vellum::test
