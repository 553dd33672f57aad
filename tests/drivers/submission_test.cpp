// Commands of the layer and of an application that a GPU's driver records and submits. What they do is nothing, as
// there is no GPU (kernel/absent_gpu.h): the driver must take them, and the layer must get on with a device that
// computes nothing.
#include "compiled.h"

#include <gtest/gtest.h>

#include "harness/pipeline_tracer.h"

namespace vellum::test
{
namespace
{

// Of unused ray flag bits: not tried, since the layer's setting says so; tried, and the bits do not come back; or they
// do.
enum class Trial { None, Lost, Kept };

struct Device {
    const char *name;
    vt::Api api;
    Trial trial = Trial::None;
};

std::ostream &operator<<(std::ostream &out, const Device &device)
{
    return out << device.name;
}

class Submission : public testing::TestWithParam<Device>
{
};

TEST_P(Submission, BuildsAndTracesAreTaken)
{
    vt::Options options{.validation = false, .spy = false};
    options.api = GetParam().api;
    options.newer = true;
    if (const std::string whyNot = useGpu(GetParam().name, options); !whyNot.empty())
        GTEST_SKIP() << whyNot;
    options.keepsFlagBits = GetParam().trial == Trial::Kept;
    setenv("VELLUM_CARRIED_RAY_FLAGS", GetParam().trial == Trial::None ? "off" : "on", 1);
    vt::Gpu gpu(options);
    vt::MicromapInput input;
    const std::vector<std::uint8_t> states(16, 2);
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
    // An intersection shader that no group has would crash ANV, without the layer as well.
    vt::PipelineTracer tracer(gpu, {.groups = {{}, {.box = true}, {.box = true, .anyHit = false}}});
    EXPECT_EQ(tracer.trace(scene, rays).size(), rays.size());
    // Where the bits are lost, the layer warns of what it cannot do then. Without a trial the harness expects that.
    const bool lost = GetParam().trial == Trial::Lost;
    std::size_t warnings = 0;
    for (const vt::Message &m : gpu.takeUnexpectedMessages()) {
        if (lost && m.id == "VELLUM-intersection-ray-flags")
            ++warnings;
        else
            ADD_FAILURE() << m.id << ": " << m.text;
    }
    EXPECT_EQ(warnings > 0, lost);
}

std::string nameOf(const testing::TestParamInfo<Device> &info)
{
    constexpr const char *kTrials[]{"", "BitsLost", "BitsKept"};
    return info.param.name + std::string(info.param.api == vt::Api::Khr ? "Khr" : "Ext") +
           kTrials[static_cast<std::size_t>(info.param.trial)];
}

INSTANTIATE_TEST_SUITE_P(Amd, Submission,
                         testing::Values(Device{"navi21", vt::Api::Ext}, Device{"navi21", vt::Api::Ext, Trial::Lost},
                                         Device{"navi21", vt::Api::Khr, Trial::Kept}, Device{"navi31", vt::Api::Khr},
                                         Device{"gfx1201", vt::Api::Ext, Trial::Kept}),
                         nameOf);
INSTANTIATE_TEST_SUITE_P(Intel, Submission,
                         testing::Values(Device{"dg2", vt::Api::Ext}, Device{"dg2", vt::Api::Khr, Trial::Lost},
                                         Device{"mtl", vt::Api::Ext}, Device{"lnl", vt::Api::Khr},
                                         Device{"bmg", vt::Api::Ext}, Device{"bmg", vt::Api::Khr, Trial::Lost}),
                         nameOf);

} // namespace
} // namespace vellum::test
