// SPDX-License-Identifier: Apache-2.0
// The states that a lossy micromap may have, and those that a build gives it.
#include <gtest/gtest.h>

#include <array>

#include "core/lossy.h"
#include "test_random.h"

using namespace vellum;

namespace
{

constexpr State T = State::Transparent;
constexpr State O = State::Opaque;
constexpr State UT = State::UnknownTransparent;
constexpr State UO = State::UnknownOpaque;

std::vector<uint8_t> packed(const std::vector<State> &states)
{
    std::vector<uint8_t> data((states.size() * 2 + 7) / 8);
    for (uint32_t i = 0; i < states.size(); ++i)
        writeState(data.data(), i, Format::FourState, states[i]);
    return data;
}

std::vector<State> unpacked(const std::vector<uint8_t> &data, uint32_t level)
{
    std::vector<State> states(microTriangleCount(level));
    for (uint32_t i = 0; i < states.size(); ++i)
        states[i] = readState(data.data(), i, Format::FourState);
    return states;
}

bool known(State state)
{
    return state == T || state == O;
}

// Runs of one state, few or many of them.
std::vector<State> randomStates(test::TestRandom &random, uint32_t level)
{
    std::vector<State> states(microTriangleCount(level));
    const uint32_t longest = random() % (2 * level + 1);
    for (size_t i = 0; i < states.size();) {
        const auto state = static_cast<State>(random() % 4);
        for (size_t run = size_t{1} << (longest > 0 ? random() % (longest + 1) : 0); run > 0; --run)
            if (i < states.size())
                states[i++] = state;
    }
    return states;
}

} // namespace

TEST(Lossy, MergesOfFour)
{
    const auto merged = [](const std::vector<State> &four) {
        return unpacked(coarsenedStates(packed(four).data(), 1, 0), 0)[0];
    };
    for (const State state : {T, O, UT, UO})
        EXPECT_EQ(merged({state, state, state, state}), state);
    EXPECT_EQ(merged({T, T, T, O}), UT);
    EXPECT_EQ(merged({T, O, O, O}), UO);
    EXPECT_EQ(merged({T, O, O, T}), UO); // even
    EXPECT_EQ(merged({T, T, UT, UT}), UT);
    EXPECT_EQ(merged({O, UO, O, O}), UO);
    EXPECT_EQ(merged({UT, UO, UT, UT}), UT);
}

// Not the majority of the majorities.
TEST(Lossy, TheGuessIsThatOfMostMicroTriangles)
{
    std::vector<State> states(16, T);
    for (const size_t i : {0u, 1u, 4u, 5u}) // two children even, and so opaque; 4 of 16 in all
        states[i] = O;
    EXPECT_EQ(unpacked(coarsenedStates(packed(states).data(), 2, 0), 0)[0], UT);
    for (const size_t i : {2u, 3u, 6u, 7u})
        states[i] = O;
    EXPECT_EQ(unpacked(coarsenedStates(packed(states).data(), 2, 0), 0)[0], UO);
}

TEST(Lossy, UniformTrianglesNeedNoData)
{
    for (uint32_t level = 0; level <= 8; ++level)
        for (const State state : {T, O, UT, UO})
            EXPECT_EQ(lossyLevel(packed(std::vector<State>(microTriangleCount(level), state)).data(), level),
                      std::min(level, 2u));
}

// One differing micro-triangle in each of the level below, which would make 3 of 4 unknown.
TEST(Lossy, FineDetailStays)
{
    std::vector<State> states(microTriangleCount(5), T);
    for (size_t i = 0; i < states.size(); i += 4)
        states[i] = O;
    EXPECT_EQ(lossyLevel(packed(states).data(), 5), 5u);
}

// 16 micro-triangles of 256 may become unknown to save all data, no more.
TEST(Lossy, AMicroTriangleHasItsPrice)
{
    std::vector<State> states(microTriangleCount(4), T);
    for (size_t i = 0; i < 4; ++i)
        states[4 * i] = O;
    EXPECT_EQ(lossyLevel(packed(states).data(), 4), 2u);
    states[16] = O;
    EXPECT_EQ(lossyLevel(packed(states).data(), 4), 4u);
    // States that are already unknown cost nothing.
    states[16] = UT;
    EXPECT_EQ(lossyLevel(packed(states).data(), 4), 4u);
    for (size_t i = 16; i < 32; ++i)
        states[i] = UT;
    EXPECT_EQ(lossyLevel(packed(states).data(), 4), 2u);
    EXPECT_EQ(lossyLevel(packed(states).data(), 4, 5), 4u);
}

TEST(Lossy, StatesOnlyBecomeUnknown)
{
    test::TestRandom random(1);
    std::array<uint32_t, 9> lowered{}; // by how many levels, as bits
    for (uint32_t i = 0; i < 600; ++i) {
        const uint32_t level = i % 9;
        const std::vector<State> before = randomStates(random, level);
        const uint32_t chosen = lossyLevel(packed(before).data(), level);
        ASSERT_LE(chosen, level);
        ASSERT_GE(chosen, std::min(level, 2u));
        lowered[level] |= 1u << (level - chosen);
        size_t least = before.size();
        uint32_t cheapest = level;
        for (uint32_t to = level; to + 1 > std::min(level, 2u); --to) {
            const std::vector<State> after = unpacked(coarsenedStates(packed(before).data(), level, to), to);
            size_t lost = 0;
            for (size_t m = 0; m < before.size(); ++m) {
                const State state = after[m >> (2 * (level - to))];
                ASSERT_TRUE(state == before[m] || !known(state));
                lost += known(before[m]) && !known(state) ? 1u : 0u;
            }
            const size_t cost = 16 * lost + (to > 2 ? after.size() : 0);
            if (cost <= least) {
                least = cost;
                cheapest = to;
            }
            if (to == chosen) {
                EXPECT_LE(16 * lost, before.size());
            }
            if (to == 0)
                break;
        }
        EXPECT_EQ(chosen, cheapest);
    }
    for (uint32_t level = 3; level < 9; ++level)
        EXPECT_GT(lowered[level], 1u) << "level " << level;
}

TEST(Lossy, MicromapsKeepTheirTriangles)
{
    Micromap micromap;
    micromap.data = {0b01010101, 0xff, 0xff};
    micromap.data.resize(20, 0x55);
    micromap.triangles = {{0, 1, Format::TwoState}, {4, 3, Format::FourState}, {1, 1, Format::FourState}};
    micromap.indices = {2, -1, 1, 0};
    micromap.baseTriangle = 0;
    const Micromap lossy = lossyMicromap(micromap);
    ASSERT_FALSE(lossy.validate());
    EXPECT_EQ(lossy.indices, micromap.indices);
    ASSERT_EQ(lossy.triangles.size(), 3u);
    EXPECT_EQ(lossy.triangles[0].format, Format::TwoState);
    EXPECT_EQ(lossy.triangles[1].subdivisionLevel, 2);
    EXPECT_EQ(lossy.triangles[2].subdivisionLevel, 1);
    for (const float u : {0.1f, 0.4f, 0.7f})
        for (uint32_t t = 0; t < 4; ++t)
            EXPECT_EQ(lossy.stateAt(t, u, 0.2f), micromap.stateAt(t, u, 0.2f));
}
