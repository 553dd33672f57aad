// SPDX-License-Identifier: Apache-2.0
#include "faulty_driver/cases/cases.h"

namespace faults
{

using namespace vt;

namespace
{

Vec3 middleOf(uint32_t triangle)
{
    return {1.5f * static_cast<float>(triangle) + 0.3f, 0.3f, 1};
}

std::vector<Vec3> middles(uint32_t triangles)
{
    std::vector<Vec3> places;
    for (uint32_t t = 0; t < triangles; ++t)
        places.push_back(middleOf(t));
    return places;
}

std::string hitsAt(Device &gpu, const Structure &scene, std::span<const Vec3> places, uint32_t flags, uint32_t cullMask)
{
    std::vector<Ray> rays;
    for (const Vec3 &place : places)
        rays.push_back({.origin = place, .flags = flags, .cullMask = cullMask});
    std::string hits;
    for (const Result &result : Tracer(gpu).trace(scene, rays))
        hits += result.committed != kNone ? 'O' : result.candidateCount > 0 ? 'n' : '.';
    return hits;
}

} // namespace

MicromapInput uniform(std::initializer_list<uint8_t> states, uint32_t level)
{
    MicromapInput input;
    for (const uint8_t state : states)
        input.add(level, kFourState, std::vector<uint8_t>(size_t{1} << 2 * level, state));
    return input;
}

std::string statesAt(Device &gpu, const Structure &scene, std::span<const Vec3> places)
{
    const std::string plain = hitsAt(gpu, scene, places, 0, 0xff);
    const std::string twoState = hitsAt(gpu, scene, places, kRayForceTwoState, 0xff);
    std::string states;
    for (size_t i = 0; i < places.size(); ++i)
        states += plain[i] == '.'      ? '0'
                  : plain[i] == 'O'    ? '1'
                  : twoState[i] == '.' ? '2'
                  : twoState[i] == 'O' ? '3'
                                       : 'n';
    return states;
}

std::string statesOf(Device &gpu, const Structure &scene, uint32_t triangles)
{
    return statesAt(gpu, scene, middles(triangles));
}

std::string hitsOf(Device &gpu, const Structure &scene, uint32_t triangles, uint32_t flags, uint32_t cullMask)
{
    return hitsAt(gpu, scene, middles(triangles), flags, cullMask);
}

RowScene::RowScene(Device &gpu, const Micromap *micromap, uint32_t triangles, Attachment attachment,
                   VkGeometryFlagsKHR flags, VkBuildAccelerationStructureFlagsKHR buildFlags)
    : gpu_(gpu), triangles_(triangles), flags_(flags), buildFlags_(buildFlags),
      blas_(std::make_unique<Blas>(gpu, std::vector{geometry(micromap, std::move(attachment))}, buildFlags)),
      tlas_(std::make_unique<Tlas>(gpu, std::vector{instance(*blas_, {}, 1)}))
{
}

Geometry RowScene::geometry(const Micromap *micromap, Attachment attachment) const
{
    Geometry geometry{.vertices = triangleRow(triangles_), .flags = flags_};
    attachment.micromap = micromap;
    geometry.micromap = std::move(attachment);
    return geometry;
}

void RowScene::update(const Micromap *micromap, Attachment attachment)
{
    blas_->build({geometry(micromap, std::move(attachment))}, buildFlags_,
                 VK_BUILD_ACCELERATION_STRUCTURE_MODE_UPDATE_KHR);
    tlas_ = std::make_unique<Tlas>(gpu_, std::vector{instance(*blas_, {}, 1)});
}

std::unique_ptr<Micromap> built(Device &gpu, MicromapInput input, VkBuildMicromapFlagsEXT flags)
{
    auto micromap = std::make_unique<Micromap>(gpu, std::move(input), flags);
    micromap->build();
    return micromap;
}

void buildFrom(Device &gpu, const Micromap &source, const Micromap &target)
{
    gpu.submit([&](VkCommandBuffer commands) {
        recordMicromapBuilds(gpu, commands, std::array{MicromapBuild{source.buildInfo(), target.handle()}});
    });
}

std::string statesOfMicromap(Device &gpu, const Micromap &micromap)
{
    return RowScene(gpu, &micromap, static_cast<uint32_t>(micromap.input().triangles.size())).states();
}

} // namespace faults
