#include "verify/walk.h"

#include <algorithm>
#include <cmath>

namespace vellum::verify
{
namespace
{

constexpr Tolerances kNone{0, 0, 0, 0};
// How many parts of one triangle may be looked at: more than any that is not made to take long needs.
constexpr std::uint64_t kWork = std::uint64_t{1} << 22;
constexpr std::uint64_t kWorkForMicroTriangle = 64;
// Going by is cheaper than looking.
constexpr std::uint64_t kMicroTrianglesForWork = 4;

LatticePoint between(const LatticePoint &a, const LatticePoint &b)
{
    return {a.i + b.i, a.j + b.j};
}

LatticePoint twice(const LatticePoint &a)
{
    return between(a, a);
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
                           const Options &options, std::uint64_t work, std::vector<Finding> *list)
    : m_texels(texels), m_claims(claims), m_options(options), m_list(list),
      m_region(texels, triangle, options.tolerances, options.rule()), m_bare(texels, triangle, kNone, options.rule()),
      m_work(std::min(work, kWork + kWorkForMicroTriangle * microTriangleCount(claims.level)))
{
    m_region.work = m_bare.work = m_work;
}

std::uint64_t TriangleWalk::leastWork(const Claims &claims)
{
    return microTriangleCount(claims.level) / kMicroTrianglesForWork + 1;
}

std::uint64_t TriangleWalk::worked() const
{
    return leastWork(m_claims) + 2 * m_work - m_region.work - m_bare.work;
}

Counts TriangleWalk::operator()()
{
    const Branch whole{{{{0, 0}, {1, 0}, {0, 1}}}, 0, 0};
    if (m_bare.measurable())
        walk(whole);
    else
        judgeUnmeasurable();
    return m_counts;
}

bool TriangleWalk::approximate() const
{
    return m_claims.data != nullptr && m_claims.format == Format::TwoState && !m_options.strictTwoState;
}

void TriangleWalk::walk(const Branch &branch)
{
    const Region &region = approximate() ? m_bare : m_region;
    const Range values = region.bounds(region.part(branch.corners, branch.level));
    if (values.low >= region.high()) {
        settled(branch, State::Opaque);
    } else if (values.high < region.low()) {
        settled(branch, State::Transparent);
    } else if (branch.level == m_claims.level) {
        judge(branch);
    } else {
        const std::array<MicroCorners, 4> children = childrenOnCurve(branch.corners);
        const std::uint32_t step = microTriangleCount(m_claims.level - branch.level - 1);
        for (std::uint32_t i = 0; i < 4; ++i)
            walk({children[i], branch.level + 1, branch.first + i * step});
    }
}

State TriangleWalk::stateOf(std::uint32_t micro) const
{
    return m_claims.data == nullptr ? m_claims.special : readState(m_claims.data, micro, m_claims.format);
}

// Whether a branch is one state; false where that is not seen byte by byte.
bool TriangleWalk::allAre(const Branch &branch, State state) const
{
    const std::uint32_t perByte = m_claims.format == Format::TwoState ? 8 : 4;
    const std::uint32_t number = microTriangleCount(m_claims.level - branch.level);
    if (m_claims.data == nullptr || number < perByte)
        return false;
    std::uint8_t byte = 0;
    for (std::uint32_t i = 0; i < perByte; ++i)
        writeState(&byte, i, m_claims.format, state);
    const std::uint8_t *first = m_claims.data + branch.first / perByte;
    return std::all_of(first, first + number / perByte, [byte](std::uint8_t b) { return b == byte; });
}

void TriangleWalk::count(State state, std::uint64_t number)
{
    if (state == State::Opaque)
        m_counts.opaque += number;
    else if (state == State::Transparent)
        m_counts.transparent += number;
    else
        m_counts.unknown += number;
}

// All values of the branch are on one side, with margins.
void TriangleWalk::settled(const Branch &branch, State truth)
{
    const std::uint32_t number = microTriangleCount(m_claims.level - branch.level);
    const bool same = allAre(branch, truth);
    if (approximate()) {
        for (std::uint32_t i = 0; i < number && !same; ++i)
            ++(stateOf(branch.first + i) == truth ? m_counts.twoStateTrue : m_counts.twoStateReversed);
        m_counts.twoStateTrue += same ? number : 0;
        return;
    }
    if (same) {
        count(truth, number);
        return;
    }
    for (std::uint32_t i = 0; i < number; ++i) {
        const State state = stateOf(branch.first + i);
        count(state);
        if (state == truth || (isUnknown(state) && m_region.far()))
            continue;
        const Kind kind = isUnknown(state) ? Kind::Needless : Kind::Wrong;
        Witness witness;
        if (m_list != nullptr && m_counts.of(kind) < m_options.maxFindings) {
            MicroCorners corners = branch.corners;
            for (std::uint32_t level = m_claims.level - branch.level; level-- > 0;)
                corners = childrenOnCurve(corners)[(i >> (2 * level)) & 3];
            witness = m_region.valueAt(m_region.part(corners, m_claims.level));
        }
        report(kind, branch.first + i, state, witness);
    }
}

void TriangleWalk::judge(const Branch &leaf)
{
    const State state = stateOf(leaf.first);
    if (approximate()) {
        judgeTwoState(leaf, state);
        return;
    }
    count(state);
    if (isUnknown(state))
        judgeUnknown(leaf, state);
    else
        judgeClaim(leaf, state);
}

void TriangleWalk::judgeClaim(const Branch &leaf, State state)
{
    const bool opaque = state == State::Opaque;
    const Ask ask = opaque ? Ask::NotOpaque : Ask::NotTransparent;
    const auto contradicted = [&](const Verdict &verdict) {
        return opaque ? verdict.notOpaque : verdict.notTransparent;
    };
    const auto witness = [&](const Verdict &verdict) {
        return opaque ? verdict.belowOpaque : verdict.aboveTransparent;
    };
    const Verdict wide = m_region(leaf.corners, leaf.level, ask);
    if (contradicted(wide) == Answer::No)
        return;
    const Verdict bare = m_bare(leaf.corners, leaf.level, ask);
    if (contradicted(bare) == Answer::Yes)
        report(Kind::Wrong, leaf.first, state, witness(bare));
    else if (contradicted(bare) == Answer::Open)
        ++m_counts.open;
    else if (contradicted(wide) == Answer::Yes)
        report(Kind::OutsideMargins, leaf.first, state, witness(wide));
}

void TriangleWalk::judgeUnknown(const Branch &leaf, State state)
{
    if (m_region.far())
        return;
    const Verdict verdict = m_region(leaf.corners, leaf.level, Ask::Both);
    if (verdict.notOpaque == Answer::No || verdict.notTransparent == Answer::No)
        report(Kind::Needless, leaf.first, state, m_region.valueAt(m_region.part(leaf.corners, leaf.level)));
}

void TriangleWalk::judgeTwoState(const Branch &leaf, State state)
{
    const Verdict verdict = m_bare(leaf.corners, leaf.level, Ask::Both);
    if (verdict.notOpaque == Answer::Yes && verdict.notTransparent == Answer::Yes) {
        ++m_counts.twoStateMixed;
    } else if (verdict.notOpaque == Answer::No) {
        ++(state == State::Opaque ? m_counts.twoStateTrue : m_counts.twoStateReversed);
    } else if (verdict.notTransparent == Answer::No) {
        ++(state == State::Transparent ? m_counts.twoStateTrue : m_counts.twoStateReversed);
    } else {
        ++m_counts.open;
        ++m_counts.twoStateMixed;
    }
}

// Nothing is known of where samples fall. A claim is true only where the whole texture is one; where coordinates are
// numbers there is a truth, which is left open.
void TriangleWalk::judgeUnmeasurable()
{
    const Range all = m_texels.all();
    const Region::Part whole = m_region.part({{{0, 0}, {1, 0}, {0, 1}}}, 0);
    const bool finite = std::all_of(whole.corners.begin(), whole.corners.end(),
                                    [](const Point &p) { return std::isfinite(p.x) && std::isfinite(p.y); });
    const bool even = std::all_of(whole.factors.begin(), whole.factors.end(), [](double f) { return f == 1; });
    const std::uint32_t number = microTriangleCount(m_claims.level);
    for (std::uint32_t i = 0; i < number; ++i) {
        const State state = stateOf(i);
        const bool holds = even && (state == State::Opaque ? all.low >= m_bare.high() : all.high < m_bare.low());
        if (approximate()) {
            ++(holds ? m_counts.twoStateTrue : m_counts.twoStateMixed);
            continue;
        }
        count(state);
        if (isUnknown(state) || holds)
            continue;
        if (finite)
            ++m_counts.open;
        else
            report(Kind::Wrong, i, state, {{std::nan(""), std::nan("")}, std::nan("")});
    }
}

void TriangleWalk::report(Kind kind, std::uint32_t micro, State state, const Witness &witness)
{
    std::uint64_t &number = m_counts.findings[static_cast<std::size_t>(kind)];
    ++number;
    if (m_list == nullptr || number > m_options.maxFindings)
        return;
    const AlphaTexture &texture = m_texels.texture();
    Finding finding;
    finding.kind = kind;
    finding.microTriangle = micro;
    finding.level = m_claims.level;
    finding.special = m_claims.data == nullptr;
    finding.state = state;
    finding.u = witness.at.x / texture.width;
    finding.v = witness.at.y / texture.height;
    finding.value = witness.value;
    m_list->push_back(finding);
}

} // namespace vellum::verify
