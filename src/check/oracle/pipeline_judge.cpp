// SPDX-License-Identifier: Apache-2.0
#include "check/oracle/pipeline_judge.h"

#include "check/oracle/query_judge.h"

#include <algorithm>
#include <cmath>

namespace vellum::check::oracle
{
namespace
{

enum Group : uint32_t { kFull, kNoAnyHit, kNoClosestHit, kBoxFull, kBoxNoAnyHit };
} // namespace

const std::array<TracerGroup, 5> kHitGroups{
    {{}, {.anyHit = false}, {.closestHit = false}, {.box = true}, {.box = true, .anyHit = false}}};
const std::array<std::optional<uint32_t>, 2 * kBoxRecords> kHitRecords = [] {
    constexpr std::array<std::optional<uint32_t>, 8> triangles{kFull,        kFull,         kNoAnyHit, kFull,
                                                               std::nullopt, kNoClosestHit, kFull,     kNoAnyHit};
    constexpr std::array<std::optional<uint32_t>, 8> boxes{kBoxFull,     kBoxFull, kBoxNoAnyHit, kBoxFull,
                                                           std::nullopt, kBoxFull, kBoxNoAnyHit, kBoxFull};
    std::array<std::optional<uint32_t>, 2 * kBoxRecords> records;
    for (size_t i = 0; i < kBoxRecords; ++i) {
        records[i] = triangles[i % triangles.size()];
        records[kBoxRecords + i] = boxes[i % boxes.size()];
    }
    return records;
}();

namespace
{

class PipelineJudge
{
public:
    PipelineJudge(const Scene &scene, const Ray &ray, const std::vector<Hit> &hits, const PipelineResult &result,
                  const Tolerance &tolerance)
        : scene_(scene), ray_(ray), hits_(hits), result_(result), tolerance_(tolerance)
    {
    }

    // What is wrong with the result; empty: nothing.
    std::string fault()
    {
        if (!result_.intact)
            return "payload changed";
        if (result_.candidateCount > kCapacity || result_.visitCount > kCapacity)
            return "too many shader invocations";
        for (const auto &check : {&PipelineJudge::visitFault, &PipelineJudge::candidateFault,
                                  &PipelineJudge::committedFault, &PipelineJudge::leftOut}) {
            const std::string what = (this->*check)();
            if (!what.empty())
                return what;
        }
        return {};
    }

private:
    [[nodiscard]] uint32_t recordOf(const Hit &hit) const { return recordOffset(scene_, hit.instance) + hit.geometry; }
    [[nodiscard]] std::optional<uint32_t> groupOf(const Hit &hit) const { return kHitRecords[recordOf(hit)]; }
    [[nodiscard]] bool asks(const Hit &hit) const
    {
        const auto group = groupOf(hit);
        return hit.opacity == Opacity::NonOpaque && group && *group != kNoAnyHit && *group != kBoxNoAnyHit;
    }
    [[nodiscard]] bool accepts(const Hit &hit) const { return !asks(hit) || confirms(ray_, hit); }
    [[nodiscard]] bool hasClosestHit(const Hit &hit) const { return groupOf(hit) && *groupOf(hit) != kNoClosestHit; }
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
            return !(at.t < ray_.generate || at.t > ray_.generate) && hitKind == 0x10 + (hit.primitive & 0xf);
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
            if (!flagsRight || visit.record != 100 + recordOf(*hit) || visit.tMin < ray_.tMin || visit.tMin > ray_.tMin)
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
            if (hit == nullptr || !asks(*hit)) {
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
            if (note.flags != ray_.flags || note.record != 100 + recordOf(*hit) || note.intact != 1)
                return describe("what the any-hit shader reads", c);
        }
        return {};
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
        const bool first = (ray_.flags & kRayTerminateOnFirstHit) != 0;
        const auto mayStay = [&](double t) { return first || t < limit_ + 1e-3; };
        for (const Hit &h : hits_)
            silent = silent || (!h.box && accepts(h) && !hasClosestHit(h) && mayStay(h.t));
        for (const Hit *h : generated_)
            silent = silent || (!hasClosestHit(*h) && mayStay(double{ray_.generate}));

        if (result_.committed == kUnknownResult)
            return silent && result_.invocations == 0 ? "" : "neither closest-hit nor miss shader ran";
        if (result_.invocations != 1)
            return "more than one closest-hit or miss shader";
        if (result_.flags != ray_.flags)
            return "ray flags read back wrong (" + std::to_string(result_.flags) + ")";
        if (result_.tMin < ray_.tMin || result_.tMin > ray_.tMin)
            return "tMin read back wrong";
        if (result_.committed == kNone) {
            if (nearest != nullptr && !seen(result_.candidates, *nearest))
                return opacityFault(scene_, ray_, *nearest, "a miss");
            if (nearest != nullptr || !generated_.empty())
                return "an accepted hit was not committed";
            return result_.record == 50 ? "" : "record of the miss shader";
        }
        const bool box = result_.committed == kGenerated;
        const Hit *hit = find(result_, box);
        if (!box && (hit == nullptr || !accepts(*hit)))
            return opacityFault(scene_, ray_, result_, "it as the committed hit");
        if (hit == nullptr || !accepts(*hit) || !hasClosestHit(*hit))
            return describe("the committed hit is not one that may be committed", result_);
        if (box && std::find(generated_.begin(), generated_.end(), hit) == generated_.end())
            return "the committed box was not reported";
        const bool othersReported = std::any_of(result_.visits.begin(), result_.visits.end(), [&](const auto &visit) {
            return visit.reported != 0 && !(box && names(*hit, visit));
        });
        if (!placed(*hit, result_, result_.hitKind) ||
            (!(othersReported && tolerance_.reportChangesAttributes) && !attributed(*hit, result_)))
            return describe("place of the committed hit", result_) + " (t " + std::to_string(result_.t) + ", u " +
                   std::to_string(result_.u) + ", v " + std::to_string(result_.v) + ", hit kind " +
                   std::to_string(result_.hitKind) + ")";
        if (result_.record != 100 + recordOf(*hit))
            return "record of the committed hit";
        if (mayStay(double{result_.t}))
            return {};
        if (nearest != nullptr && double{result_.t} > nearest->t + 1e-3 && !seen(result_.candidates, *nearest))
            return opacityFault(scene_, ray_, *nearest, "none, but a hit farther away");
        return describe("the committed hit is not the nearest", result_);
    }

    // Nearer than the hit that stays, nothing may have been left out.
    std::string leftOut()
    {
        if ((ray_.flags & kRayTerminateOnFirstHit) != 0 && result_.committed != kNone)
            return {};
        for (const Hit &h : hits_) {
            if (!h.certain || h.t > limit_ - 1e-3)
                continue;
            if (h.box && groupOf(h) && !seen(result_.visits, h))
                return describe("a box was left out", h);
            if (!h.box && asks(h) && !seen(result_.candidates, h))
                return opacityFault(scene_, ray_, h, "none");
            if (h.box && asks(h) && ray_.generate > 0 && double{ray_.generate} < limit_ - 1e-3 &&
                !seen(result_.candidates, h))
                return describe("a reported hit was left out", h);
        }
        return {};
    }

    const Scene &scene_;
    const Ray &ray_;
    const std::vector<Hit> &hits_;
    const PipelineResult &result_;
    const Tolerance &tolerance_;
    std::vector<const Hit *> generated_;
    double limit_ = 0;
};

} // namespace

Tolerance toleranceFor(const Device &gpu)
{
    return {gpu.hasFault(Fault::LayerIntersectionShaders), gpu.hasFault(Fault::ReportChangesAttributes)};
}

std::string pipelineFault(const Scene &scene, const Ray &ray, const std::vector<Hit> &hits,
                          const PipelineResult &result, const Tolerance &tolerance)
{
    return PipelineJudge(scene, ray, hits, result, tolerance).fault();
}

} // namespace vellum::check::oracle
