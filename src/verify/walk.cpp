// SPDX-License-Identifier: Apache-2.0
#include "verify/walk.h"

#include <algorithm>
#include <cmath>

namespace vellum::verify
{
namespace
{

constexpr Tolerances kNone{0, 0, 0, 0};
// The number of parts of one triangle to examine: enough for every triangle that is not made to take long.
constexpr uint64_t kWork = uint64_t{1} << 22;
constexpr uint64_t kWorkForMicroTriangle = 64;
// Going by is cheaper than looking.
constexpr uint64_t kMicroTrianglesForWork = 4;

LatticePoint between(const LatticePoint &a, const LatticePoint &b)
{
    return {a.i + b.i, a.j + b.j};
}

LatticePoint twice(const LatticePoint &a)
{
    return between(a, a);
}

// Returns whether a baker may leave the whole triangle unknown: the alphas of its vertices differ or are not those of a
// texture, or there are too many of them. With alpha 0 the texture does not matter.
bool alphasMayBeSkipped(const std::array<float, 3> &alpha, bool manyAlphas)
{
    const bool same = alpha[0] == alpha[1] && alpha[0] == alpha[2];
    return !same || !(alpha[0] >= 0 && alpha[0] <= 1) || (manyAlphas && alpha[0] != 0);
}

bool isUnknown(State state)
{
    return state != State::Opaque && state != State::Transparent;
}

} // namespace

std::array<MicroCorners, 4> childrenOnCurve(const MicroCorners &corners)
{
    // Each is entered at its first corner and left at its last, where the next is entered.
    const auto &[a, b, c] = corners;
    return {{{twice(a), between(a, b), between(c, a)},
             {between(c, a), between(b, c), between(a, b)},
             {between(a, b), twice(b), between(b, c)},
             {between(b, c), between(c, a), twice(c)}}};
}

TriangleWalk::TriangleWalk(const Texels &texels, const TriangleCorners &triangle, const Claims &claims,
                           const Options &options, uint64_t work, std::vector<Finding> *list)
    : texels_(texels), claims_(claims),
      mayBeSkipped_(claims.data == nullptr && alphasMayBeSkipped(triangle.alpha, options.manyAlphas)),
      options_(options), list_(list), region_(texels, triangle, options.tolerances, options.rule()),
      bare_(texels, triangle, kNone, options.rule()),
      work_(std::min(work, kWork + kWorkForMicroTriangle * microTriangleCount(claims.level)))
{
    region_.work = bare_.work = work_;
}

uint64_t TriangleWalk::leastWork(const Claims &claims)
{
    return microTriangleCount(claims.level) / kMicroTrianglesForWork + 1;
}

uint64_t TriangleWalk::worked() const
{
    return leastWork(claims_) + 2 * work_ - region_.work - bare_.work;
}

Counts TriangleWalk::operator()()
{
    const Branch whole{{{{0, 0}, {1, 0}, {0, 1}}}, 0, 0};
    if (bare_.measurable())
        walk(whole);
    else
        decideUnmeasurable();
    return counts_;
}

bool TriangleWalk::approximate() const
{
    return claims_.format == Format::TwoState && !options_.strictTwoState;
}

// Returns whether unknown states are justified: the triangle is far away, or its vertex alphas are not baked.
bool TriangleWalk::mayBeUnknown() const
{
    return region_.far() || mayBeSkipped_;
}

void TriangleWalk::walk(const Branch &branch)
{
    const Region &region = approximate() ? bare_ : region_;
    const Range values = region.bounds(region.part(branch.corners, branch.level));
    if (values.low >= region.high()) {
        settled(branch, State::Opaque);
    } else if (values.high < region.low()) {
        settled(branch, State::Transparent);
    } else if (branch.level == claims_.level) {
        decide(branch);
    } else {
        const std::array<MicroCorners, 4> children = childrenOnCurve(branch.corners);
        const uint32_t step = microTriangleCount(claims_.level - branch.level - 1);
        for (uint32_t i = 0; i < 4; ++i)
            walk({children[i], branch.level + 1, branch.first + i * step});
    }
}

State TriangleWalk::stateOf(uint32_t micro) const
{
    return claims_.data == nullptr ? claims_.special : readState(claims_.data, micro, claims_.format);
}

// Returns whether a branch is one state; false where that is not seen byte by byte.
bool TriangleWalk::allAre(const Branch &branch, State state) const
{
    const uint32_t perByte = claims_.format == Format::TwoState ? 8 : 4;
    const uint32_t number = microTriangleCount(claims_.level - branch.level);
    if (claims_.data == nullptr || number < perByte)
        return false;
    uint8_t byte = 0;
    for (uint32_t i = 0; i < perByte; ++i)
        writeState(&byte, i, claims_.format, state);
    const uint8_t *first = claims_.data + branch.first / perByte;
    return std::all_of(first, first + number / perByte, [byte](uint8_t b) { return b == byte; });
}

void TriangleWalk::count(State state, uint64_t number)
{
    if (state == State::Opaque)
        counts_.opaque += number;
    else if (state == State::Transparent)
        counts_.transparent += number;
    else
        counts_.unknown += number;
}

// All values of the branch are on one side, with margins.
void TriangleWalk::settled(const Branch &branch, State truth)
{
    const uint32_t number = microTriangleCount(claims_.level - branch.level);
    const bool same = allAre(branch, truth);
    if (approximate()) {
        for (uint32_t i = 0; i < number && !same; ++i)
            ++(stateOf(branch.first + i) == truth ? counts_.twoStateTrue : counts_.twoStateReversed);
        counts_.twoStateTrue += same ? number : 0;
        return;
    }
    if (same) {
        count(truth, number);
        return;
    }
    for (uint32_t i = 0; i < number; ++i) {
        const State state = stateOf(branch.first + i);
        count(state);
        if (state == truth || (isUnknown(state) && mayBeUnknown()))
            continue;
        const Kind kind = isUnknown(state) ? Kind::Needless : Kind::Wrong;
        Witness witness;
        if (list_ != nullptr && counts_.of(kind) < options_.maxFindings) {
            MicroCorners corners = branch.corners;
            for (uint32_t level = claims_.level - branch.level; level-- > 0;)
                corners = childrenOnCurve(corners)[(i >> (2 * level)) & 3];
            witness = region_.valueAt(region_.part(corners, claims_.level));
        }
        report(kind, branch.first + i, state, witness);
    }
}

void TriangleWalk::decide(const Branch &leaf)
{
    const State state = stateOf(leaf.first);
    if (approximate()) {
        decideTwoState(leaf, state);
        return;
    }
    count(state);
    if (isUnknown(state))
        decideUnknown(leaf, state);
    else
        decideClaim(leaf, state);
}

void TriangleWalk::decideClaim(const Branch &leaf, State state)
{
    const bool opaque = state == State::Opaque;
    const Ask ask = opaque ? Ask::NotOpaque : Ask::NotTransparent;
    const auto contradicted = [&](const Verdict &verdict) {
        return opaque ? verdict.notOpaque : verdict.notTransparent;
    };
    const auto witness = [&](const Verdict &verdict) {
        return opaque ? verdict.belowOpaque : verdict.aboveTransparent;
    };
    const Verdict wide = region_(leaf.corners, leaf.level, ask);
    if (contradicted(wide) == Answer::No)
        return;
    const Verdict bare = bare_(leaf.corners, leaf.level, ask);
    if (contradicted(bare) == Answer::Yes)
        report(Kind::Wrong, leaf.first, state, witness(bare));
    else if (contradicted(bare) == Answer::Open)
        ++counts_.open;
    else if (contradicted(wide) == Answer::Yes)
        report(Kind::OutsideMargins, leaf.first, state, witness(wide));
}

void TriangleWalk::decideUnknown(const Branch &leaf, State state)
{
    if (mayBeUnknown())
        return;
    const Verdict verdict = region_(leaf.corners, leaf.level, Ask::Both);
    if (verdict.notOpaque == Answer::No || verdict.notTransparent == Answer::No)
        report(Kind::Needless, leaf.first, state, region_.valueAt(region_.part(leaf.corners, leaf.level)));
}

void TriangleWalk::decideTwoState(const Branch &leaf, State state)
{
    const Verdict verdict = bare_(leaf.corners, leaf.level, Ask::Both);
    if (verdict.notOpaque == Answer::Yes && verdict.notTransparent == Answer::Yes) {
        ++counts_.twoStateMixed;
    } else if (verdict.notOpaque == Answer::No) {
        ++(state == State::Opaque ? counts_.twoStateTrue : counts_.twoStateReversed);
    } else if (verdict.notTransparent == Answer::No) {
        ++(state == State::Transparent ? counts_.twoStateTrue : counts_.twoStateReversed);
    } else {
        ++counts_.open;
        ++counts_.twoStateMixed;
    }
}

// The locations of samples are unknown. A claim is true only if it holds for the whole texture; if coordinates are
// finite there is a truth, which stays undecided.
void TriangleWalk::decideUnmeasurable()
{
    const Range all = texels_.all();
    const Region::Part whole = region_.part({{{0, 0}, {1, 0}, {0, 1}}}, 0);
    const bool finite = std::all_of(whole.corners.begin(), whole.corners.end(),
                                    [](const Point &p) { return std::isfinite(p.x) && std::isfinite(p.y); });
    const bool even = std::all_of(whole.factors.begin(), whole.factors.end(), [](double f) { return f == 1; });
    const uint32_t number = microTriangleCount(claims_.level);
    for (uint32_t i = 0; i < number; ++i) {
        const State state = stateOf(i);
        const bool holds = even && (state == State::Opaque ? all.low >= bare_.high() : all.high < bare_.low());
        if (approximate()) {
            ++(holds ? counts_.twoStateTrue : counts_.twoStateMixed);
            continue;
        }
        count(state);
        if (isUnknown(state) || holds)
            continue;
        if (finite)
            ++counts_.open;
        else
            report(Kind::Wrong, i, state, {{std::nan(""), std::nan("")}, std::nan("")});
    }
}

void TriangleWalk::report(Kind kind, uint32_t micro, State state, const Witness &witness)
{
    uint64_t &number = counts_.findings[static_cast<size_t>(kind)];
    ++number;
    if (list_ == nullptr || number > options_.maxFindings)
        return;
    const AlphaTexture &texture = texels_.texture();
    Finding finding;
    finding.kind = kind;
    finding.microTriangle = micro;
    finding.level = claims_.level;
    finding.special = claims_.data == nullptr;
    finding.state = state;
    finding.u = witness.at.x / texture.width;
    finding.v = witness.at.y / texture.height;
    finding.value = witness.value;
    list_->push_back(finding);
}

} // namespace vellum::verify
