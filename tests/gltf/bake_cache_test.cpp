// SPDX-License-Identifier: Apache-2.0
// The cache of results: what its keys depend on, damaged values, and the folder that keeps them.
#include "gltf/micromaps/bake_cache.h"

#include <algorithm>
#include <array>
#include <chrono>
#include <cstring>
#include <functional>
#include <gtest/gtest.h>
#include <map>
#include <string_view>
#include <thread>

#ifndef _WIN32
#include <csignal>
#include <sys/resource.h>
#endif

#include "compressed.h"
#include "core/hash.h"
#include "glb_file.h"
#include "gltf/file/cache_folder.h"
#include "gltf/file/gltf_error.h"
#include "gltf/micromaps/file_bake.h"
#include "test_random.h"

using namespace vellum;
using namespace vellum::test;

namespace
{

namespace fs = std::filesystem;

Digest digestOf(std::string_view text)
{
    Sha256 sha256;
    sha256.add({reinterpret_cast<const uint8_t *>(text.data()), text.size()});
    return sha256.finish();
}

std::string hexOf(const Digest &digest)
{
    std::string text;
    for (const uint8_t byte : digest) {
        text += "0123456789abcdef"[byte >> 4];
        text += "0123456789abcdef"[byte & 15];
    }
    return text;
}

// Triangles, of which the second half is an input of its own, and the options to bake them with.
struct Bake {
    BakeOptions options;
    AlphaTexture texture;
    std::vector<TriangleUvs> triangles;
    std::vector<double> weights;
    std::vector<uint8_t> levels;
    std::vector<Format> formats;
    std::optional<double> cutoff;
    std::optional<double> valueTolerance;
    double uvTerms = 0;
    uint32_t group = 1; // of the second half

    [[nodiscard]] std::array<BakeInput, 2> inputs() const
    {
        std::array<BakeInput, 2> both;
        for (const size_t half : {0u, 1u}) {
            const auto part = [&](const auto &all) {
                return std::span(all).subspan(half == 0 || all.empty() ? 0 : 3,
                                              half != 0 || all.empty() ? std::dynamic_extent : 3);
            };
            BakeInput &input = both[half];
            input.textures = {&texture, 1};
            input.triangles = part(triangles);
            input.levels = part(levels);
            input.formats = part(formats);
            input.cutoff = cutoff;
            input.valueTolerance = valueTolerance;
            input.uvTerms = uvTerms;
            input.group = half == 0 ? 0 : group;
            if (options.budget)
                input.weights = part(weights);
        }
        return both;
    }
    [[nodiscard]] Digest key() const { return bakeKey(inputs(), std::array<Digest, 1>{digestOf("texture")}, options); }
    [[nodiscard]] std::vector<uint8_t> result() const
    {
        return cacheValueOf(bake(inputs(), options).micromap, Digest{});
    }
};

Bake randomBake(TestRandom &random)
{
    Bake bake;
    bake.options.threads = 1;
    AlphaTexture &texture = bake.texture;
    texture.width = texture.height = 32;
    for (int i = 0; i < 32 * 32; ++i) {
        const int x = i % 32 - 16;
        const int y = i / 32 - 16;
        texture.alpha.push_back(x * x + y * y < 150 ? 0.6f + 0.01f * static_cast<float>(random() % 32) : 0.2f);
    }
    for (int i = 0; i < 6; ++i) {
        TriangleUvs &uvs = bake.triangles.emplace_back();
        for (TexCoord &corner : uvs)
            corner = {static_cast<float>(random.uniform(0, 1)), static_cast<float>(random.uniform(0, 1))};
        bake.weights.push_back(random.uniform(0, 1));
    }
    if (random() % 2 == 0) // data that both inputs share
        std::copy_n(bake.triangles.begin(), 3, bake.triangles.begin() + 3);
    if (random() % 2 == 0)
        bake.options.level = random() % 5;
    if (random() % 3 == 0)
        bake.options.budget = random() % 400;
    if (random() % 3 == 0)
        bake.options.format = Format::TwoState;
    if (random() % 4 == 0)
        bake.levels = {0, 1, 2, 3, 4, 5};
    if (random() % 4 == 0)
        bake.formats = {Format::TwoState,  Format::FourState, Format::TwoState,
                        Format::FourState, Format::FourState, Format::FourState};
    if (random() % 3 == 0)
        bake.cutoff = 0.5;
    return bake;
}

using Change = std::function<void(Bake &, TestRandom &)>;

// One for each member that results depend on, sometimes or always.
const std::map<std::string, Change> kChanges = {
    {"format",
     [](Bake &b, TestRandom &) {
         b.options.format = b.options.format == Format::TwoState ? Format::FourState : Format::TwoState;
     }},
    {"twoStateRule",
     [](Bake &b, TestRandom &r) {
         b.options.twoStateRule = r() % 2 == 0 ? TwoStateRule::UnknownIsOpaque : TwoStateRule::UnknownIsTransparent;
     }},
    {"level", [](Bake &b, TestRandom &) { b.options.level = b.options.level.value_or(2) + 1; }},
    {"no level",
     [](Bake &b, TestRandom &) { b.options.level = b.options.level ? std::nullopt : std::optional<uint32_t>(3); }},
    {"maxLevel", [](Bake &b, TestRandom &r) { b.options.maxLevel = r() % 4; }},
    {"texelsPerEdge", [](Bake &b, TestRandom &r) { b.options.texelsPerEdge = r.uniform(1, 20); }},
    {"budget", [](Bake &b, TestRandom &r) { b.options.budget = r() % 300; }},
    {"leastKnown",
     [](Bake &b, TestRandom &) {
         b.options.budget.reset();
         b.options.leastKnown = 0; // more may be impossible
     }},
    {"emptyGroupBytes", [](Bake &b, TestRandom &r) { b.options.emptyGroupBytes = r() % 200; }},
    {"minKnown", [](Bake &b, TestRandom &r) { b.options.minKnown = r.uniform(0.1, 1); }},
    {"disallowMixedSpecialIndices", [](Bake &b, TestRandom &) { b.options.disallowMixedSpecialIndices = true; }},
    {"cutoff", [](Bake &b, TestRandom &r) { b.options.cutoff = r.uniform(0, 1); }},
    {"test", [](Bake &b, TestRandom &) { b.options.test = AlphaTest::Less; }},
    {"valueTolerance", [](Bake &b, TestRandom &r) { b.options.valueTolerance = r.uniform(0, 0.2); }},
    {"subtexelTolerance", [](Bake &b, TestRandom &r) { b.options.subtexelTolerance = r.uniform(0, 2); }},
    {"barycentricTolerance", [](Bake &b, TestRandom &r) { b.options.barycentricTolerance = r.uniform(0, 0.1); }},
    {"interpolationTolerance", [](Bake &b, TestRandom &r) { b.options.interpolationTolerance = r.uniform(0, 0.0009); }},
    {"input.cutoff", [](Bake &b, TestRandom &r) { b.cutoff = r.uniform(0, 1); }},
    {"input.valueTolerance", [](Bake &b, TestRandom &r) { b.valueTolerance = r.uniform(0, 0.2); }},
    {"input.uvTerms", [](Bake &b, TestRandom &) { b.uvTerms = 4096; }},
    {"input.triangles", [](Bake &b, TestRandom &r) { b.triangles[r() % 6][r() % 3].u += 0.125f; }},
    {"input.triangles, their order", [](Bake &b, TestRandom &) { std::swap(b.triangles[0], b.triangles[5]); }},
    {"input.triangles, their corners", [](Bake &b, TestRandom &) { std::swap(b.triangles[0][0], b.triangles[0][1]); }},
    {"input.triangles, their number",
     [](Bake &b, TestRandom &) {
         b.triangles.pop_back();
         b.weights.pop_back();
         if (!b.levels.empty())
             b.levels.pop_back();
         if (!b.formats.empty())
             b.formats.pop_back();
     }},
    {"input.levels", [](Bake &b, TestRandom &r) { b.levels.assign(6, static_cast<uint8_t>(r() % 6)); }},
    {"input.formats", [](Bake &b, TestRandom &) { b.formats.assign(6, Format::TwoState); }},
    {"input.group", [](Bake &b, TestRandom &) { b.group = 0; }},
    {"input.weights", [](Bake &b, TestRandom &r) { b.weights[r() % 6] = 100; }},
};

// The card, baked with what a map has kept.
struct CachedBakes {
    std::map<Digest, std::vector<uint8_t>> values;
    DocumentBakeOptions options;

    CachedBakes()
    {
        options.bake.level = 4;
        options.cache.get = [this](const Digest &key) {
            const auto found = values.find(key);
            return found == values.end() ? std::nullopt : std::optional(found->second);
        };
        options.cache.put = [this](const Digest &key, std::span<const uint8_t> value) {
            values[key].assign(value.begin(), value.end());
        };
    }
    CachedBakes(const CachedBakes &) = delete;
    CachedBakes &operator=(const CachedBakes &) = delete;

    // The file that is written.
    static Bytes write(const fs::path &path, DocumentBakeOptions with, DocumentBake *made = nullptr)
    {
        FileBakeOptions wanted;
        static_cast<DocumentBakeOptions &>(wanted) = std::move(with);
        Bytes bytes;
        wanted.sink = [&bytes](const FileContent &content) {
            for (const std::span<const uint8_t> piece : content.pieces())
                bytes.insert(bytes.end(), piece.begin(), piece.end());
        };
        FileBake bake = bakeFile(path, path, wanted);
        if (made != nullptr)
            *made = std::move(bake.bake);
        return bytes;
    }
    // Returns the number of hits, having compared the bytes with those without a cache.
    size_t hits(const Bytes &glb)
    {
        const TemporaryFolder folder;
        writeFile(folder / "card.glb", glb);
        DocumentBakeOptions plain = options;
        plain.cache = {};
        DocumentBake made;
        EXPECT_EQ(write(folder / "card.glb", options, &made), write(folder / "card.glb", plain));
        EXPECT_EQ(made.cacheHits + made.cacheMisses, options.bake.budget ? 1 : made.micromaps.size());
        return made.cacheHits;
    }
    size_t hits(const Replacements &replacements = {}) { return hits(cardGlb(replacements)); }
};

// The card with other bytes at a place in its binary chunk.
Bytes changedCard(size_t offset, Bytes bytes)
{
    Bytes glb = cardGlb();
    uint32_t length = 0;
    std::memcpy(&length, &glb[12], sizeof length);
    std::copy(bytes.begin(), bytes.end(), glb.begin() + 28 + length + static_cast<ptrdiff_t>(offset));
    return glb;
}

std::vector<fs::path> filesIn(const fs::path &folder)
{
    std::vector<fs::path> files;
    for (const fs::directory_entry &entry : fs::recursive_directory_iterator(folder))
        if (entry.is_regular_file())
            files.push_back(entry.path());
    return files;
}

Bytes valueOf(size_t size, uint8_t byte)
{
    return Bytes(size, byte);
}

// A key in one of the folders, different for each number.
Digest keyIn(uint8_t folder, uint8_t number)
{
    Digest key{};
    key[0] = folder;
    key[31] = number;
    return key;
}

} // namespace

TEST(Sha256, KnownDigests)
{
    EXPECT_EQ(hexOf(digestOf("")), "e3b0c44298fc1c149afbf4c8996fb92427ae41e4649b934ca495991b7852b855");
    EXPECT_EQ(hexOf(digestOf("abc")), "ba7816bf8f01cfea414140de5dae2223b00361a396177a9cb410ff61f20015ad");
    Sha256 sha256;
    const Bytes thousand(1000, 'a');
    for (int i = 0; i < 1000; ++i)
        sha256.add(thousand);
    EXPECT_EQ(hexOf(sha256.finish()), "cdc76e5c9914fb9281a1c7e284d73e67f1809a48a497200e046d39ccc7112cd0");
}

// A change of any member that changes the result changes the key.
TEST(BakeKey, DiffersWhereResultsDo)
{
    TestRandom random(1);
    std::map<std::string, int> different;
    for (int i = 0; i < 150; ++i) {
        const Bake bake = randomBake(random);
        const std::vector<uint8_t> result = bake.result();
        for (const auto &[name, change] : kChanges) {
            Bake changed = bake;
            change(changed, random);
            if (changed.result() == result)
                continue;
            ++different[name];
            EXPECT_NE(changed.key(), bake.key()) << name;
        }
    }
    for (const auto &[name, change] : kChanges)
        EXPECT_GT(different[name], 0) << name << " never changed a result";
}

TEST(BakeKey, IsTheSameWhereResultsCannotDiffer)
{
    TestRandom random(2);
    Bake bake = randomBake(random);
    bake.options.level = 3;
    bake.options.budget.reset();
    bake.options.format = Format::FourState;
    bake.levels.clear();
    bake.formats.clear();
    bake.cutoff = 0.5;
    bake.valueTolerance = 0.01;
    for (const char *name : {"twoStateRule", "maxLevel", "texelsPerEdge", "emptyGroupBytes", "cutoff", "valueTolerance",
                             "input.weights"}) {
        Bake changed = bake;
        kChanges.at(name)(changed, random);
        EXPECT_EQ(changed.key(), bake.key()) << name;
    }
    Bake other = bake;
    other.options.threads = 7;
    other.options.progress = [](size_t, size_t) {};
    other.options.cancelled = [] { return false; };
    EXPECT_EQ(other.key(), bake.key());
    other.options.format = Format::TwoState;
    const Digest twoState = other.key();
    other.options.minKnown = 0.5;
    EXPECT_EQ(other.key(), twoState);
    other.options.maxDataBytes = 1000; // it may fail
    EXPECT_NE(other.key(), twoState);
}

TEST(BakeCacheValue, IsWholeOrNothing)
{
    TestRandom random(4);
    const Bake bake = randomBake(random);
    const Micromap micromap = vellum::bake(bake.inputs(), bake.options).micromap;
    const Digest key = bake.key();
    const std::vector<uint8_t> value = cacheValueOf(micromap, key);
    const std::optional<Micromap> read = micromapOf(value, key, 6);
    ASSERT_TRUE(read);
    EXPECT_EQ(read->data, micromap.data);
    EXPECT_EQ(read->indices, micromap.indices);
    EXPECT_EQ(cacheValueOf(*read, key), value);
    EXPECT_FALSE(micromapOf(value, digestOf("another key"), 6));
    EXPECT_FALSE(micromapOf(value, key, 5));
    for (size_t size = 0; size < value.size(); ++size)
        EXPECT_FALSE(micromapOf(std::span(value).first(size), key, 6)) << size;
    for (size_t i = 0; i < value.size(); ++i) {
        std::vector<uint8_t> damaged = value;
        damaged[i] ^= static_cast<uint8_t>(1u << random() % 8);
        EXPECT_FALSE(micromapOf(damaged, key, 6)) << i;
    }
    // Made on purpose: data outside of the micromap.
    Micromap wrong = micromap;
    wrong.indices.front() = 1000;
    EXPECT_FALSE(micromapOf(cacheValueOf(wrong, key), key, 6));
    wrong = micromap;
    wrong.triangles.push_back({1u << 30, 12, Format::FourState});
    EXPECT_FALSE(micromapOf(cacheValueOf(wrong, key), key, 6));
}

TEST(BakeCache, OtherPartsOfAFileKeepTheHit)
{
    CachedBakes bakes;
    EXPECT_EQ(bakes.hits(), 0u);
    EXPECT_EQ(bakes.hits(), 1u);
    const std::vector<Replacements> same = {
        {{R"("translation": [0, 2, 0])", R"("name": "another", "translation": [1, 2, 3])"}},
        {{R"("name": "leaf")", R"("name": "leaf of something")"}},
        {{R"("baseColorFactor": [1, 0.5, 0.25, 0.75])", R"("baseColorFactor": [0, 0, 0, 0.75])"}},
        {{R"({"attributes": {"POSITION": 3}, "material": 1})", R"({"attributes": {"POSITION": 3}})"}},
        {{R"("meshes": [)", R"("meshes": [{"primitives": [{"attributes": {"POSITION": 3}}]}, )"}},
        {{R"("magFilter": 9728)", R"("minFilter": 9984, "magFilter": 9728)"}},
    };
    for (const Replacements &replacements : same)
        EXPECT_EQ(bakes.hits(replacements), 1u) << replacements.front().second;
    EXPECT_EQ(bakes.hits(changedCard(0, valueOf(8, 0x3f))), 1u) << "a position";
    EXPECT_EQ(bakes.values.size(), 1u);
}

TEST(BakeCache, WhatTheResultDependsOnDoesNot)
{
    CachedBakes bakes;
    EXPECT_EQ(bakes.hits(), 0u);
    const std::vector<Replacements> different = {
        {{R"("magFilter": 9728, )", ""}},
        {{R"("wrapS": 33071, )", ""}},
        {{R"("wrapT": 33648)", R"("wrapT": 33071)"}},
        {{R"("baseColorFactor": [1, 0.5, 0.25, 0.75])", R"("baseColorFactor": [1, 0.5, 0.25, 0.5])"}},
        {{R"("alphaCutoff": 0.25)", R"("alphaCutoff": 0.375)"}},
        {{R"("index": 0})", R"("index": 0, "extensions": {"KHR_texture_transform": {"scale": [0.5, 1]}}})"}},
        {{kCardPrimitive, kCardPrimitive + ", " + kCardPrimitive}},
    };
    size_t misses = 1;
    for (const Replacements &replacements : different) {
        EXPECT_EQ(bakes.hits(replacements), 0u) << replacements.front().first;
        EXPECT_EQ(bakes.values.size(), ++misses);
        EXPECT_EQ(bakes.hits(replacements), 1u) << replacements.front().first;
    }
    EXPECT_EQ(bakes.hits(changedCard(48, {0, 0, 0, 0x3f})), 0u) << "a texture coordinate";
    EXPECT_EQ(bakes.hits(changedCard(80, {1, 0})), 0u) << "an index";
    // A byte of the compressed image, not that of its checksum.
    EXPECT_EQ(bakes.hits(), 1u);
    bakes.options.bake.level = 5;
    EXPECT_EQ(bakes.hits(), 0u);
    bakes.options.bake.level.reset();
    EXPECT_EQ(bakes.hits(), 0u);
    EXPECT_EQ(bakes.hits(), 1u);
}

// Keys have images and accessors as they are stored, so a version also has what becomes of them.
TEST(BakeCache, ResultsOfFilesAreThoseOfTheVersion)
{
    TestRandom random(3);
    constexpr uint32_t kSize = 64;
    const auto blobs = [&](size_t bytesPerTexel) {
        Bytes texels(kSize * kSize * bytesPerTexel);
        Bytes coarse(64);
        for (uint8_t &value : coarse)
            value = static_cast<uint8_t>(random() % 256);
        for (size_t i = 0; i < texels.size(); ++i) {
            const size_t texel = i / bytesPerTexel;
            texels[i] = static_cast<uint8_t>(coarse[texel / 512 * 8 + texel % 64 / 8] + random() % 64);
        }
        return texels;
    };
    const Bytes images[] = {pngImage(kSize, kSize, 8, kRgba, false, blobs(4)),
                            pngImage(kSize, kSize, 16, kGrayAlpha, false, blobs(4)), jpegImage(kSize, kSize, blobs(3))};
    const std::pair<std::string, std::string> linear = {R"("magFilter": 9728, )", ""};
    const std::vector<Replacements> readings = {
        {},
        {linear, {R"("wrapS": 33071, "wrapT": 33648)", R"("wrapS": 10497)"}},
        {linear,
         {R"("index": 0})",
          R"("index": 0, "extensions": {"KHR_texture_transform": {"scale": [0.3, 1.7], "rotation": 1}}})"}},
        {{R"("alphaMode": "MASK", "alphaCutoff": 0.25)", R"("alphaMode": "BLEND")"}},
    };
    const TemporaryFolder folder;
    DocumentBakeOptions options;
    options.blend = true;
    uint64_t all = 0;
    const auto add = [&](const auto &values) { all = hashBytes(values.data(), values.size() * sizeof values[0], all); };
    for (const Bytes &image : images)
        for (const Replacements &reading : readings) {
            writeCardGltf(folder / "card.gltf", image, reading);
            const DocumentBake bake = bakeDocument(Document(folder / "card.gltf"), options);
            ASSERT_EQ(bake.micromaps.size(), 1u);
            add(bake.micromaps[0].data);
            add(bake.micromaps[0].triangles);
            add(bake.primitives.at(0).micromap.indices);
        }
    // If results have to differ: raise kBakeVersion, and write the new hash here.
    EXPECT_EQ(kBakeVersion, 2u);
    EXPECT_EQ(all, 8506572873737079560u);
}

// A budget is shared over all of a file, by the surface of its triangles.
TEST(BakeCache, WithABudget)
{
    CachedBakes bakes;
    bakes.options.bake.level.reset();
    bakes.options.bake.budget = 100;
    EXPECT_EQ(bakes.hits(), 0u);
    EXPECT_EQ(bakes.hits(), 1u);
    EXPECT_EQ(bakes.hits({{R"("translation": [0, 2, 0])", R"("translation": [1, 2, 3])"}}), 1u);
    bakes.options.bake.budget = 101;
    EXPECT_EQ(bakes.hits(), 0u);
    EXPECT_EQ(bakes.values.size(), 2u);
}

// A hit decodes nothing: here the image cannot be decoded.
TEST(BakeCache, AHitReadsNoImage)
{
    const Bytes damaged = changedCard(92 + 20, Bytes(8, 0xee));
    CachedBakes bakes;
    const TemporaryFolder folder;
    writeFile(folder / "card.glb", damaged);
    EXPECT_THROW(bakeDocument(Document(folder / "card.glb"), bakes.options), GltfError);
    EXPECT_TRUE(bakes.values.empty());
    Micromap made;
    made.indices = {specialIndex(State::Opaque), specialIndex(State::Transparent)};
    bakes.options.cache.get = [&](const Digest &key) { return std::optional(cacheValueOf(made, key)); };
    const DocumentBake bake = bakeDocument(Document(folder / "card.glb"), bakes.options);
    EXPECT_EQ(bake.cacheHits, 1u);
    ASSERT_EQ(bake.primitives.size(), 1u);
    EXPECT_EQ(bake.primitives[0].micromap.indices, made.indices);
}

TEST(BakeCache, DamagedValuesAreReplaced)
{
    CachedBakes bakes;
    EXPECT_EQ(bakes.hits(), 0u);
    std::vector<uint8_t> &value = bakes.values.begin()->second;
    const std::vector<uint8_t> whole = value;
    for (const bool truncated : {true, false}) {
        if (truncated)
            value.resize(value.size() / 2);
        else
            value.back() ^= 1;
        EXPECT_EQ(bakes.hits(), 0u);
        EXPECT_EQ(value, whole);
    }
}

TEST(CacheFolder, KeepsValues)
{
    const TemporaryFolder folder;
    CacheFolder cache(folder / "a/b", uint64_t{1} << 30);
    EXPECT_FALSE(cache.get(keyIn(1, 1)));
    EXPECT_FALSE(fs::exists(folder / "a"));
    cache.put(keyIn(1, 1), valueOf(1000, 1));
    cache.put(keyIn(1, 2), {});
    cache.put(keyIn(65, 1), valueOf(2000, 3)); // the same folder
    CacheFolder again(folder / "a/b", uint64_t{1} << 30);
    EXPECT_EQ(again.get(keyIn(1, 1)), valueOf(1000, 1));
    EXPECT_EQ(again.get(keyIn(1, 2)), Bytes{});
    EXPECT_EQ(again.get(keyIn(65, 1)), valueOf(2000, 3));
    again.put(keyIn(1, 1), valueOf(3, 9));
    EXPECT_EQ(cache.get(keyIn(1, 1)), valueOf(3, 9));
    EXPECT_EQ(cache.problem(), "");
    EXPECT_EQ(filesIn(folder.path()).size(), 3u);
}

// A folder's part: 8 blocks. Values have one each.
TEST(CacheFolder, RemovesWhatWasNotUsed)
{
    const TemporaryFolder folder;
    CacheFolder cache(folder / "cache", CacheFolder::kFolders * 8 * 4096);
    const auto age = [&](uint8_t number, int minutes) {
        for (const fs::path &file : filesIn(folder / "cache"))
            if (file.filename().string() == hexOf(keyIn(5, number)))
                fs::last_write_time(file, fs::file_time_type::clock::now() - std::chrono::minutes(minutes));
    };
    for (uint8_t i = 0; i < 8; ++i) {
        cache.put(keyIn(5, i), valueOf(100, i));
        age(i, 100 - i);
    }
    EXPECT_EQ(filesIn(folder / "cache").size(), 8u);
    EXPECT_TRUE(cache.get(keyIn(5, 0))); // used now
    cache.put(keyIn(6, 0), valueOf(100, 0));
    cache.put(keyIn(5, 8), valueOf(100, 8));
    EXPECT_TRUE(cache.get(keyIn(5, 0)));
    EXPECT_TRUE(cache.get(keyIn(5, 8)));
    EXPECT_FALSE(cache.get(keyIn(5, 1)));
    EXPECT_FALSE(cache.get(keyIn(5, 2)));
    EXPECT_TRUE(cache.get(keyIn(5, 3)));
    EXPECT_TRUE(cache.get(keyIn(6, 0)));
    // Too large for any folder.
    cache.put(keyIn(7, 0), valueOf(9 * 4096, 1));
    EXPECT_FALSE(cache.get(keyIn(7, 0)));
    EXPECT_EQ(cache.problem(), "");
}

// As processes that keep one value each. A folder's part: 64 blocks, of which 4 are put before it is counted.
TEST(CacheFolder, OfManyProcessesSomeCountItsBytes)
{
    const TemporaryFolder folder;
    constexpr uint64_t kSize = CacheFolder::kFolders * 64 * 4096;
    for (uint32_t i = 0; i < 250; ++i)
        CacheFolder(folder / "cache", kSize).put(keyIn(5, static_cast<uint8_t>(i)), valueOf(100, 1));
    EXPECT_LE(filesIn(folder / "cache").size(), 128u);
    // Of folders that are full, a process with one small value counts few.
    size_t counted = 0;
    for (const char *name : {"a", "b", "c", "d"}) {
        const fs::path old = folder / name / "micromaps/05/old";
        fs::create_directories(old.parent_path());
        writeFile(old, {1});
        fs::resize_file(old, 65u << 20);
        CacheFolder(folder / name, CacheFolder::kFolders * (uint64_t{64} << 20)).put(keyIn(5, 1), valueOf(100, 1));
        counted += fs::exists(old) ? 0u : 1u;
    }
    EXPECT_LT(counted, 4u);
}

// By their hidden names, until a process that would still write them must have been killed.
TEST(CacheFolder, FilesThatAreBeingWrittenStay)
{
    const TemporaryFolder folder;
    const fs::path file = folder / "micromaps/05/.new";
    fs::create_directories(file.parent_path());
    writeFile(file, valueOf(9 * 4096, 1));
    CacheFolder cache(folder.path(), CacheFolder::kFolders * 8 * 4096);
    cache.put(keyIn(5, 1), valueOf(100, 1));
    EXPECT_TRUE(fs::exists(file));
    fs::last_write_time(file, fs::file_time_type::clock::now() - std::chrono::hours(2));
    cache.put(keyIn(5, 2), valueOf(100, 1));
    EXPECT_FALSE(fs::exists(file));
    EXPECT_TRUE(cache.get(keyIn(5, 1)));
}

TEST(CacheFolder, SharedByThreads)
{
    const TemporaryFolder folder;
    constexpr uint64_t kSize = CacheFolder::kFolders * 16 * 4096;
    {
        std::vector<std::jthread> threads;
        for (uint32_t t = 0; t < 4; ++t)
            threads.emplace_back([&, t] {
                CacheFolder cache(folder / "cache", kSize); // as a process of its own
                TestRandom random(t);
                for (int i = 0; i < 500; ++i) {
                    const Digest key = keyIn(static_cast<uint8_t>(random() % 4), static_cast<uint8_t>(random() % 100));
                    const Bytes expected = valueOf(500 + size_t{key[31]} * 50, key[31]);
                    EXPECT_EQ(cache.get(key).value_or(expected), expected);
                    cache.put(key, expected);
                }
                EXPECT_EQ(cache.problem(), "");
            });
    }
    for (const fs::path &file : filesIn(folder / "cache")) {
#ifdef _WIN32 // Wine's ReplaceFile() leaves rf<digits>.tmp where somebody reads the file that it replaces
        if (file.filename().string().starts_with("rf"))
            continue;
#endif
        EXPECT_EQ(file.filename().string().size(), 64u) << file;
    }
    for (const fs::directory_entry &part : fs::directory_iterator(folder / "cache/micromaps"))
        EXPECT_LE(filesIn(part.path()).size(), 17u) << part;
}

TEST(CacheFolder, ReportsOneProblem)
{
    const TemporaryFolder folder;
    writeFile(folder / "file", {1});
    CacheFolder cache(folder / "file", uint64_t{1} << 30);
    cache.put(keyIn(1, 1), valueOf(10, 1));
    const std::string problem = cache.problem();
    EXPECT_NE(problem, "");
    cache.put(keyIn(1, 2), valueOf(10, 1));
    EXPECT_FALSE(cache.get(keyIn(1, 1)));
    EXPECT_EQ(cache.problem(), problem);
}

#ifndef _WIN32
TEST(CacheFolder, AFullDisk)
{
    const TemporaryFolder folder;
    CacheFolder cache(folder / "cache", uint64_t{1} << 30);
    cache.put(keyIn(1, 1), valueOf(10, 1));
    rlimit before{};
    ASSERT_EQ(getrlimit(RLIMIT_FSIZE, &before), 0);
    rlimit small = before;
    small.rlim_cur = 1000;
    const auto handler = std::signal(SIGXFSZ, SIG_IGN);
    ASSERT_EQ(setrlimit(RLIMIT_FSIZE, &small), 0);
    cache.put(keyIn(1, 2), valueOf(3000, 1));
    setrlimit(RLIMIT_FSIZE, &before);
    std::signal(SIGXFSZ, handler);
    EXPECT_NE(cache.problem(), "");
    EXPECT_FALSE(cache.get(keyIn(1, 2)));
    EXPECT_TRUE(cache.get(keyIn(1, 1)));
    EXPECT_EQ(filesIn(folder.path()).size(), 1u);
}
#endif
