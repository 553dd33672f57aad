// SPDX-License-Identifier: Apache-2.0
// Images that the files of one run share.
#include <gtest/gtest.h>

#include <atomic>
#include <stdexcept>
#include <thread>

#include "gltf/alpha_textures.h"

using namespace vellum;

namespace
{

std::vector<uint8_t> encoded(uint8_t number)
{
    return std::vector<uint8_t>(10, number);
}

// What an image of 1,000 bytes and 10 encoded ones counts.
constexpr size_t kBytes = 1000 + 10 + 512;

Image image(uint8_t number)
{
    return {25, 10, std::vector<uint8_t>(1000, number)};
}

} // namespace

TEST(DecodedImages, EachIsDecodedOnceByAnyThread)
{
    DecodedImages images;
    std::atomic<int> decoded = 0;
    std::atomic<int> wrong = 0;
    std::vector<std::thread> threads;
    for (int t = 0; t < 4; ++t)
        threads.emplace_back([&] {
            for (int n = 0; n < 100; ++n) {
                const auto number = static_cast<uint8_t>(n % 10);
                const auto found = images.get(encoded(number), [&] {
                    ++decoded;
                    std::this_thread::yield();
                    return image(number);
                });
                wrong += found->rgba[999] == number ? 0 : 1;
            }
        });
    for (std::thread &thread : threads)
        thread.join();
    EXPECT_EQ(decoded, 10);
    EXPECT_EQ(wrong, 0);
}

TEST(DecodedImages, KeepsThoseThatWereUsedLast)
{
    DecodedImages images(3 * kBytes);
    std::vector<int> decoded;
    const auto use = [&](int n) {
        const auto number = static_cast<uint8_t>(n);
        return images.get(encoded(number), [&] {
            decoded.push_back(n);
            return image(number);
        });
    };
    for (const int number : {1, 2, 3, 1, 4, 1, 3, 2})
        EXPECT_EQ(use(number)->rgba[0], number);
    EXPECT_EQ(decoded, (std::vector<int>{1, 2, 3, 4, 2}));
    // One that is larger than all that may be kept is handed out, and not kept.
    DecodedImages small(kBytes - 1);
    int count = 0;
    for (int n = 0; n < 2; ++n)
        EXPECT_EQ(small
                      .get(encoded(7),
                           [&] {
                               ++count;
                               return image(7);
                           })
                      ->rgba[0],
                  7);
    EXPECT_EQ(count, 2);
}

TEST(DecodedImages, AFailureIsNotKept)
{
    DecodedImages images;
    EXPECT_THROW(images.get(encoded(1), []() -> Image { throw std::runtime_error("damaged"); }), std::runtime_error);
    EXPECT_EQ(images.get(encoded(1), [] { return image(1); })->rgba[0], 1);
}

// Those that wait for an image that fails decode it themselves.
TEST(DecodedImages, AllSeeAFailure)
{
    DecodedImages images;
    std::atomic<int> failed = 0;
    std::vector<std::thread> threads;
    for (int t = 0; t < 4; ++t)
        threads.emplace_back([&] {
            for (int n = 0; n < 50; ++n)
                try {
                    images.get(encoded(static_cast<uint8_t>(n)), []() -> Image {
                        std::this_thread::yield();
                        throw std::runtime_error("damaged");
                    });
                } catch (const std::runtime_error &) {
                    ++failed;
                }
        });
    for (std::thread &thread : threads)
        thread.join();
    EXPECT_EQ(failed, 200);
}
