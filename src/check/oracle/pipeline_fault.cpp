// SPDX-License-Identifier: Apache-2.0
#include "check/oracle/pipeline_fault.h"

#include "check/oracle/query_fault.h"

#include <algorithm>
#include <cmath>
#include <iterator>

namespace vellum::check::oracle
{
namespace
{

constexpr uint32_t kMostRecords = 1u << 18;
constexpr VkPipelineCreateFlags kNoNullHitShaders = VK_PIPELINE_CREATE_RAY_TRACING_NO_NULL_ANY_HIT_SHADERS_BIT_KHR |
                                                    VK_PIPELINE_CREATE_RAY_TRACING_NO_NULL_CLOSEST_HIT_SHADERS_BIT_KHR |
                                                    VK_PIPELINE_CREATE_RAY_TRACING_NO_NULL_INTERSECTION_SHADERS_BIT_KHR;

constexpr std::array kMixture{HitRecord::Full, HitRecord::Full,          HitRecord::WithoutAnyHit,
                              HitRecord::Full, HitRecord::Null,          HitRecord::WithoutClosestHit,
                              HitRecord::Full, HitRecord::WithoutAnyHit, HitRecord::Full,
                              HitRecord::Full, HitRecord::WithoutAnyHit, HitRecord::Full,
                              HitRecord::Null, HitRecord::Full,          HitRecord::WithoutAnyHit,
                              HitRecord::Full};

HitRecord recordAt(const TablePlan &table, uint32_t i)
{
    return table.records.empty() ? kMixture[i % kMixture.size()] : table.records[i % table.records.size()];
}

// The group at an index of hitGroups.
std::optional<uint32_t> groupAt(const TablePlan &table, uint32_t i, bool box)
{
    const HitRecord record = recordAt(table, i);
    if (record == HitRecord::Null)
        return {};
    return static_cast<uint32_t>(record) + (box ? 4u : 0u);
}

// "Hit Shaders" of the indexing rules; SBT offset and stride have 4 bits (OpTraceRayKHR).
uint64_t recordIndex(const Scene &scene, const TracedBy &by, uint32_t instance, uint32_t geometry)
{
    if (by.table.layout.zeroStride)
        return 0;
    return uint64_t{recordOffset(scene, instance)} + uint64_t{geometry} * (by.parameters.recordStride & 15) +
           (by.parameters.recordOffset & 15);
}

// The hits that reach each record.
struct Reached {
    bool triangles = false, boxes = false;
};
std::vector<Reached> reachedRecords(const Scene &scene, const TracedBy &by)
{
    std::vector<Reached> records;
    for (uint32_t i = 0; i < scene.instances.size(); ++i) {
        const Object &object = scene.objects[scene.instances[i].object];
        for (uint32_t g = 0; g < object.meshes.size(); ++g) {
            const uint64_t index = std::min<uint64_t>(recordIndex(scene, by, i, g), kMostRecords);
            if (records.size() <= index)
                records.resize(static_cast<size_t>(index) + 1);
            (object.hasBoxes() ? records[index].boxes : records[index].triangles) = true;
        }
    }
    return records;
}
} // namespace

const std::array<TracerGroup, 8> kHitGroups{{{},
                                             {.anyHit = false},
                                             {.closestHit = false},
                                             {.anyHit = false, .closestHit = false},
                                             {.box = true},
                                             {.box = true, .anyHit = false},
                                             {.box = true, .closestHit = false},
                                             {.box = true, .anyHit = false, .closestHit = false}}};

std::vector<TracerGroup> hitGroups(VkPipelineCreateFlags flags)
{
    std::vector<TracerGroup> groups(kHitGroups.begin(), kHitGroups.end());
    for (TracerGroup &group : groups) {
        group.anyHit |= (flags & VK_PIPELINE_CREATE_RAY_TRACING_NO_NULL_ANY_HIT_SHADERS_BIT_KHR) != 0;
        group.closestHit |= (flags & VK_PIPELINE_CREATE_RAY_TRACING_NO_NULL_CLOSEST_HIT_SHADERS_BIT_KHR) != 0;
    }
    return groups;
}

const std::array<std::optional<uint32_t>, 2 *kBoxRecords> kHitRecords = [] {
    std::array<std::optional<uint32_t>, 2 * kBoxRecords> records;
    for (uint32_t i = 0; i < records.size(); ++i)
        records[i] = groupAt({}, i, i >= kBoxRecords);
    return records;
}();

TracerTable tableOf(const Scene &scene, const TracedBy &by)
{
    const std::vector<Reached> reached = reachedRecords(scene, by);
    TracerTable table{.content = by.table.content, .data = by.data, .layout = by.table.layout};
    for (uint32_t i = 0; i < by.table.length.value_or(static_cast<uint32_t>(reached.size())); ++i) {
        const bool used = i < reached.size() && (reached[i].triangles || reached[i].boxes);
        table.hit.push_back(used ? groupAt(by.table, i, reached[i].boxes) : std::nullopt);
    }
    table.miss.assign(by.table.misses, true);
    table.miss[by.parameters.missIndex & 0xffff] = !by.table.nullMiss;
    return table;
}

std::string tableRule(const Scene &scene, const TracedBy &by, bool relay)
{
    const TablePlan &table = by.table;
    if ((by.parameters.missIndex & 0xffff) >= table.misses)
        return "the miss index is beyond the miss records";
    if (table.nullMiss && (by.flags & VK_PIPELINE_CREATE_RAY_TRACING_NO_NULL_MISS_SHADERS_BIT_KHR) != 0)
        return "VUID-vkCmdTraceRaysKHR-flags-03511: a zero miss record";
    const std::vector<Reached> reached = reachedRecords(scene, by);
    if (reached.size() > kMostRecords)
        return "too many hit records";
    for (uint32_t i = 0; i < reached.size(); ++i) {
        const bool null = recordAt(table, i) == HitRecord::Null;
        if (!null && reached[i].triangles && reached[i].boxes)
            return "VUID-vkCmdTraceRaysKHR-pHitShaderBindingTable-04735: triangles and boxes reach one hit record";
        if (null && (reached[i].triangles || reached[i].boxes) && (by.flags & kNoNullHitShaders) != 0)
            return "VUID-vkCmdTraceRaysKHR-flags-03512: a zero hit record";
    }
    const uint32_t length = table.length.value_or(static_cast<uint32_t>(reached.size()));
    if (length == 0 && (by.flags & kNoNullHitShaders) != 0)
        return "VUID-vkCmdTraceRaysKHR-flags-03696: no hit table";
    if (relay && (table.layout.zeroStride || length < reached.size() ||
                  (by.flags & (VK_PIPELINE_CREATE_RAY_TRACING_SKIP_TRIANGLES_BIT_KHR |
                               VK_PIPELINE_CREATE_RAY_TRACING_NO_NULL_ANY_HIT_SHADERS_BIT_KHR)) != 0))
        return "rays do not meet the closest-hit shader that traces";
    // Opaque hits of rays that skip closest-hit shaders need no record.
    const bool boxes = std::ranges::any_of(reached, &Reached::boxes);
    const uint32_t needed = kRayOpaque | kRaySkipClosestHit | (boxes ? kRaySkipBoxes : 0);
    if (length < reached.size() &&
        !std::ranges::all_of(scene.rays, [&](const Ray &ray) { return (ray.flags & needed) == needed; }))
        return "rays read beyond the hit records";
    // VUID-RuntimeSpirv-OpTraceRayKHR-06553 and 06554
    const uint32_t skipped =
        ((by.flags & VK_PIPELINE_CREATE_RAY_TRACING_SKIP_TRIANGLES_BIT_KHR) != 0 ? kRaySkipBoxes : 0) |
        ((by.flags & VK_PIPELINE_CREATE_RAY_TRACING_SKIP_AABBS_BIT_KHR) != 0 ? kRaySkipTriangles : 0);
    if (std::ranges::any_of(scene.rays, [&](const Ray &ray) { return (ray.flags & skipped) != 0; }))
        return "rays and pipeline skip triangles and boxes";
    return {};
}

namespace
{

class PipelineFaults
{
public:
    PipelineFaults(const Scene &scene, const Ray &ray, const std::vector<Hit> &hits, const PipelineResult &result,
                   const Tolerance &tolerance, const TracedBy &by)
        : scene_(scene), ray_(ray), hits_(hits), result_(result), tolerance_(tolerance), by_(by),
          groups_(hitGroups(by.flags))
    {
    }

    // The fault of the result; empty: none.
    std::string fault()
    {
        if (!result_.intact)
            return "payload changed";
        if (result_.visitCount >= kDecoyVisit)
            return "an intersection shader ran that no record names";
        for (const auto &check : {&PipelineFaults::visitFault, &PipelineFaults::candidateFault}) {
            const std::string what = (this->*check)();
            if (!what.empty())
                return what;
        }
        // Shaders may run any number of times. No more of what they see is kept, so nothing can be said of the others.
        if (result_.candidateCount > kCapacity || result_.visitCount > kCapacity)
            return {};
        const std::string what = committedFault();
        return what.empty() ? missingFault() : what;
    }

private:
    [[nodiscard]] uint32_t recordOf(const Hit &hit) const
    {
        return static_cast<uint32_t>(recordIndex(scene_, by_, hit.instance, hit.geometry));
    }
    [[nodiscard]] const TracerGroup *groupOf(const Hit &hit) const
    {
        const uint32_t record = recordOf(hit);
        const auto group = groupAt(by_.table, record, hit.box);
        return group && (!by_.table.length || record < *by_.table.length) ? &groups_[*group] : nullptr;
    }
    // Returns whether shaders read that record's data, of which the first is `first`.
    [[nodiscard]] bool reads(uint32_t data, uint32_t first, uint32_t record) const
    {
        return data == (by_.table.content == RecordData::None ? kUnknownResult : by_.data + first + record);
    }
    [[nodiscard]] bool isCandidate(const Hit &hit) const
    {
        const TracerGroup *group = groupOf(hit);
        return hit.opacity == Opacity::NonOpaque && group != nullptr && group->anyHit;
    }
    [[nodiscard]] bool accepts(const Hit &hit) const { return !isCandidate(hit) || confirms(ray_, hit); }
    [[nodiscard]] bool hasClosestHit(const Hit &hit) const
    {
        const TracerGroup *group = groupOf(hit);
        return group != nullptr && group->closestHit && (ray_.flags & kRaySkipClosestHit) == 0;
    }
    // The candidate at which an any-hit shader ended the ray.
    [[nodiscard]] const Candidate *end() const
    {
        const auto confirmed = std::ranges::find_if(result_.candidates, &Candidate::confirmed);
        return ray_.rule == kTerminate && confirmed != result_.candidates.end() ? &*confirmed : nullptr;
    }
    template <class T>
    [[nodiscard]] const Hit *find(const T &named, bool box) const
    {
        const auto hit =
            std::find_if(hits_.begin(), hits_.end(), [&](const Hit &h) { return h.box == box && names(h, named); });
        return hit == hits_.end() ? nullptr : &*hit;
    }
    template <class T>
    [[nodiscard]] bool placed(const Hit &hit, const T &at, uint32_t hitKind) const
    {
        if (hit.box)
            return !(at.t < ray_.generate || at.t > ray_.generate) &&
                   hitKind == hitKindOfBox(hit.primitive, hit.geometry);
        return std::abs(double{at.t} - hit.t) < 1e-3 && hitKind == (hit.frontFace ? kHitKindFront : kHitKindBack);
    }
    template <class T>
    [[nodiscard]] static bool attributed(const Hit &hit, const T &at)
    {
        if (hit.box)
            return std::abs(at.u - static_cast<float>(hit.primitive) - 0.25f) < 1e-6f &&
                   std::abs(at.v - static_cast<float>(hit.geometry) - 0.5f) < 1e-6f;
        return std::abs(double{at.u} - hit.u) < 1e-3 && std::abs(double{at.v} - hit.v) < 1e-3;
    }
    template <class List>
    static bool seen(const List &list, const Hit &hit)
    {
        return std::any_of(list.begin(), list.end(), [&hit](const auto &x) { return names(hit, x); });
    }
    template <class T>
    static std::string describe(const char *what, const T &x)
    {
        return what + inWords(x);
    }

    std::string visitFault()
    {
        for (const BoxVisit &visit : result_.visits) {
            const Hit *hit = find(visit, true);
            if (hit == nullptr && visit.reported != 3 && tolerance_.layerIntersectionShaders &&
                intersectionMayRunCulled(ray_.flags))
                continue;
            if (hit == nullptr || !groupOf(*hit))
                return describe("an intersection shader ran for a box that is not met", visit);
            const bool flagsRight = visit.flags == ray_.flags || (tolerance_.layerIntersectionShaders &&
                                                                  intersectionMaySee(visit.flags, ray_.flags));
            if (!flagsRight || !reads(visit.record, 100, recordOf(*hit)) || visit.tMin < ray_.tMin ||
                visit.tMin > ray_.tMin)
                return describe("what the intersection shader reads", visit);
            if (visit.reported == 3) {
                if (!accepts(*hit))
                    return describe("a reported hit was accepted that the any-hit shader ignores", visit);
                generated_.push_back(hit);
            }
        }
        return {};
    }

    std::string candidateFault()
    {
        for (size_t i = 0; i < result_.candidates.size(); ++i) {
            const Candidate &c = result_.candidates[i];
            const CandidateNote &note = result_.notes[i];
            const Hit *hit = find(c, c.box());
            if (hit == nullptr || !isCandidate(*hit)) {
                const bool byOpacity = !c.box() && (hit == nullptr || hit->opacity == Opacity::Opaque);
                return byOpacity ? opacityFault(scene_, ray_, c, "a candidate to an any-hit shader")
                                 : describe("an any-hit shader ran that should not", c);
            }
            if (cameAgain(*hit, result_.candidates))
                return describe("an any-hit shader ran twice for a triangle", c);
            if (!placed(*hit, c, note.hitKind) || !attributed(*hit, c))
                return describe("place of a candidate", c);
            if (c.confirmed() != confirms(ray_, *hit))
                return describe("what the any-hit shader decides", c);
            if (note.flags != ray_.flags || !reads(note.record, 100, recordOf(*hit)) || note.intact != 1)
                return describe("what the any-hit shader reads", c);
        }
        return {};
    }

    // The hits one of which stays where a candidate ends the ray: it, and those that were found without any-hit shaders
    // and are nearer: "If t > t_max, the candidate is dropped" (Ray Closest Hit Determination).
    [[nodiscard]] std::vector<const Hit *> lastHits(const Candidate *end) const
    {
        if (end == nullptr)
            return {};
        std::vector<const Hit *> last{find(*end, end->box())};
        const auto isNearer = [end](double t) { return t < double{end->t} + 1e-3; };
        for (const Hit &hit : hits_)
            if (!hit.box && !isCandidate(hit) && isNearer(hit.t))
                last.push_back(&hit);
        for (const Hit *hit : generated_)
            if (isNearer(double{ray_.generate}))
                last.push_back(hit);
        return last;
    }

    // The hit that stays: the nearest accepted triangle, or what an intersection shader reported.
    std::string committedFault()
    {
        const Hit *nearest = nullptr;
        bool silent = false; // a hit that may stay, without a closest-hit shader
        for (const Hit &h : hits_) {
            if (!h.box && accepts(h) && (nearest == nullptr || h.t < nearest->t))
                nearest = &h;
        }
        limit_ = std::min(nearest != nullptr ? nearest->t : double{ray_.tMax},
                          generated_.empty() ? double{ray_.tMax} : double{ray_.generate});
        const Candidate *const end = this->end();
        const std::vector<const Hit *> last = lastHits(end);
        if (end != nullptr && std::ranges::none_of(last, [&](const Hit *hit) {
                return hasClosestHit(*hit) ? names(*hit, result_) : result_.committed == kUnknownResult;
            }))
            return describe("an any-hit shader ended the ray, and neither its hit nor a nearer one is committed", *end);
        const bool first = end != nullptr || (ray_.flags & kRayTerminateOnFirstHit) != 0;
        for (const auto &visit : result_.visits) {
            const Hit *hit = visit.reported == 1 ? find(visit, true) : nullptr;
            if (hit != nullptr && accepts(*hit) && !first && generated_.empty() && ray_.generate >= ray_.tMin &&
                double{ray_.generate} < limit_ - 1e-3)
                return describe("reportIntersectionEXT rejected a hit that is to be accepted", visit);
        }
        const auto mayStay = [&](double t) { return first || t < limit_ + 1e-3; };
        for (const Hit &h : hits_)
            silent = silent || (!h.box && accepts(h) && !hasClosestHit(h) && mayStay(h.t));
        for (const Hit *h : generated_)
            silent = silent || (!hasClosestHit(*h) && mayStay(double{ray_.generate}));
        if (end != nullptr)
            silent = std::ranges::any_of(last, [&](const Hit *hit) { return !hasClosestHit(*hit); });

        const bool missed = nearest == nullptr && generated_.empty() && end == nullptr;
        if (result_.committed == kUnknownResult)
            return (silent || (missed && by_.table.nullMiss)) && result_.invocations == 0
                       ? ""
                       : "neither closest-hit nor miss shader ran";
        if (result_.invocations != 1)
            return "more than one closest-hit or miss shader";
        if (result_.flags != ray_.flags)
            return "ray flags read back wrong (" + std::to_string(result_.flags) + ")";
        if (result_.tMin < ray_.tMin || result_.tMin > ray_.tMin)
            return "tMin read back wrong";
        if (result_.committed == kNone) {
            if (nearest != nullptr && !seen(result_.candidates, *nearest))
                return opacityFault(scene_, ray_, *nearest, Deviation::Lost, "a miss");
            if (nearest != nullptr || !generated_.empty())
                return "an accepted hit was not committed";
            if (by_.table.nullMiss)
                return "a miss shader of a zero record ran";
            return reads(result_.record, 50, by_.parameters.missIndex & 0xffff) ? "" : "record of the miss shader";
        }
        const bool box = result_.committed == kGenerated;
        const Hit *hit = find(result_, box);
        if (!box && (hit == nullptr || !accepts(*hit)))
            return opacityFault(scene_, ray_, result_, "it as the committed hit");
        if (hit == nullptr || !accepts(*hit) || !hasClosestHit(*hit))
            return describe("the committed hit is not one that may be committed", result_);
        if (box && end == nullptr && std::find(generated_.begin(), generated_.end(), hit) == generated_.end())
            return "the committed box was not reported";
        const bool othersReported = std::any_of(result_.visits.begin(), result_.visits.end(), [&](const auto &visit) {
            return visit.reported != 0 && !(box && names(*hit, visit));
        });
        if (!placed(*hit, result_, result_.hitKind) ||
            (!(othersReported && tolerance_.reportChangesAttributes) && !attributed(*hit, result_)))
            return describe("place of the committed hit", result_) + " (t " + std::to_string(result_.t) + ", u " +
                   std::to_string(result_.u) + ", v " + std::to_string(result_.v) + ", hit kind " +
                   std::to_string(result_.hitKind) + ")";
        if (!reads(result_.record, 100, recordOf(*hit)))
            return "record of the committed hit";
        if (mayStay(double{result_.t}))
            return {};
        if (nearest != nullptr && double{result_.t} > nearest->t + 1e-3 && !seen(result_.candidates, *nearest))
            return opacityFault(scene_, ray_, *nearest, Deviation::Lost, "none, but a hit farther away");
        return describe("the committed hit is not the nearest", result_);
    }

    // No candidate nearer than the final hit may be missing.
    std::string missingFault()
    {
        if (end() != nullptr || ((ray_.flags & kRayTerminateOnFirstHit) != 0 && result_.committed != kNone))
            return {};
        for (const Hit &h : hits_) {
            if (!h.certain || h.t > limit_ - 1e-3)
                continue;
            if (h.box && groupOf(h) && !seen(result_.visits, h))
                return describe("a box is missing", h);
            if (!h.box && isCandidate(h) && !seen(result_.candidates, h))
                return opacityFault(scene_, ray_, h, Deviation::Lost, "none");
            if (h.box && isCandidate(h) && ray_.generate > 0 && double{ray_.generate} < limit_ - 1e-3 &&
                !seen(result_.candidates, h))
                return describe("a reported hit is missing", h);
        }
        return {};
    }

    const Scene &scene_;
    const Ray &ray_;
    const std::vector<Hit> &hits_;
    const PipelineResult &result_;
    const Tolerance &tolerance_;
    const TracedBy &by_;
    const std::vector<TracerGroup> groups_;
    std::vector<const Hit *> generated_;
    double limit_ = 0;
};

} // namespace

Tolerance toleranceFor(const Device &gpu)
{
    return {gpu.hasFault(Fault::LayerIntersectionShaders), gpu.hasFault(Fault::ReportChangesAttributes)};
}

std::string pipelineFault(const Scene &scene, const Ray &ray, const std::vector<Hit> &hits,
                          const PipelineResult &result, const Tolerance &tolerance, const TracedBy &by)
{
    const auto skipped = [&](const Hit &hit) {
        return (by.flags & (hit.box ? VK_PIPELINE_CREATE_RAY_TRACING_SKIP_AABBS_BIT_KHR
                                    : VK_PIPELINE_CREATE_RAY_TRACING_SKIP_TRIANGLES_BIT_KHR)) != 0;
    };
    std::vector<Hit> left;
    std::ranges::remove_copy_if(hits, std::back_inserter(left), skipped);
    return PipelineFaults(scene, ray, left, result, tolerance, by).fault();
}

} // namespace vellum::check::oracle
