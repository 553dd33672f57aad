// SPDX-License-Identifier: Apache-2.0
// Verification of files: what is read of them, and to what it leads.
#include "verify/file.h"

#include <cstring>
#include <gtest/gtest.h>

#include "card_file.h"
#include "compressed.h"
#include "gltf/data/image.h"
#include "gltf/micromaps/file_bake.h"
#include "verify_cases.h"

using namespace vellum;
using namespace vellum::test;
using verify::FileOptions;
using verify::FileReport;
using verify::Finding;
using verify::Kind;

namespace
{

CardFile bakedCard(uint32_t level = 3)
{
    CardFile card;
    BakeOptions options;
    options.level = level;
    card.bake(options);
    return card;
}

FileReport verifyCard(const CardFile &card, const FileOptions &options = {})
{
    const TemporaryFolder folder;
    writeFile(folder / "card.glb", card.bytes());
    return verify::verifyDocument(Document(folder / "card.glb"), options);
}

// The file of a card with these alphas of its vertices, baked and verified.
FileReport verifyBaked(const std::vector<float> &alphas)
{
    CardFile card;
    card.extension = false;
    card.alphas = alphas;
    const TemporaryFolder folder;
    writeFile(folder / "card.glb", card.bytes());
    FileBakeOptions options;
    options.bake.level = 4;
    bakeFile(folder / "card.glb", folder / "baked.glb", options);
    return verify::verifyDocument(Document(folder / "baked.glb"), {});
}

// A card of one state.
CardFile cardOf(State state)
{
    CardFile card = bakedCard();
    card.micromap.indices = {specialIndex(state), specialIndex(state)};
    return card;
}

} // namespace

TEST(VerifyFile, FindsNothingInABakedFile)
{
    CardFile card = bakedCard();
    card.cards = 2;
    size_t reported = 0;
    FileOptions options;
    options.progress = [&](size_t done, size_t total) {
        EXPECT_EQ(total, 4u);
        EXPECT_GE(done, reported);
        reported = done;
    };
    const FileReport report = verifyCard(card, options);
    EXPECT_EQ(report.stored.extension, "EXT_mesh_opacity_micromap");
    EXPECT_TRUE(report.findings.empty());
    EXPECT_TRUE(report.unverified.empty());
    ASSERT_EQ(report.primitives.size(), 2u);
    EXPECT_EQ(report.primitives[1].name, "mesh 0 \"leaves\" primitive 1");
    EXPECT_EQ(report.primitives[1].material, "leaf");
    EXPECT_EQ(report.primitives[1].triangles, 2u);
    EXPECT_EQ(report.level4State, 3);
    EXPECT_EQ(report.level2State, -1);
    EXPECT_FALSE(report.mixedSpecialIndices);
    EXPECT_EQ(report.counts().microTriangles(), 4 * microTriangleCount(3));
    EXPECT_GT(report.counts().opaque, 0u);
    EXPECT_GT(report.counts().transparent, 0u);
    for (size_t kind = 0; kind < verify::kKinds; ++kind)
        EXPECT_EQ(report.counts().findings[kind], 0u);
    EXPECT_EQ(reported, 4u);
}

TEST(VerifyFile, FindsAWrongStateWhereItIs)
{
    CardFile card = bakedCard();
    ASSERT_GE(card.micromap.indices[1], 0);
    const MicromapTriangle &t = card.micromap.triangles[static_cast<size_t>(card.micromap.indices[1])];
    uint8_t *data = card.micromap.data.data() + t.dataOffset;
    uint32_t micro = 0;
    while (readState(data, micro, t.format) != State::Opaque)
        ++micro;
    writeState(data, micro, t.format, State::Transparent);
    const FileReport report = verifyCard(card);
    ASSERT_EQ(report.primitives.size(), 1u);
    // The triangles have the same data only if they are the same.
    ASSERT_NE(card.micromap.indices[0], card.micromap.indices[1]);
    ASSERT_EQ(report.primitives[0].result.findings.size(), 1u);
    const Finding &f = report.primitives[0].result.findings[0];
    EXPECT_EQ(f.kind, Kind::Wrong);
    EXPECT_EQ(f.triangle, 1u);
    EXPECT_EQ(f.microTriangle, micro);
    EXPECT_EQ(f.level, 3u);
    EXPECT_EQ(f.state, State::Transparent);
    EXPECT_GE(f.value, 0.5);
}

TEST(VerifyFile, MaterialsWithoutAlphaTestAreOpaque)
{
    for (const State state : {State::Opaque, State::Transparent, State::UnknownOpaque}) {
        CardFile card = cardOf(state);
        card.material = R"("alphaMode": "OPAQUE")";
        card.alphas = {0, 0, 0, 0};
        const verify::Counts counts = verifyCard(card).counts();
        EXPECT_EQ(counts.of(Kind::Wrong), state == State::Transparent ? 2u : 0u);
        EXPECT_EQ(counts.of(Kind::Needless), state == State::UnknownOpaque ? 2u : 0u);
    }
}

TEST(VerifyFile, UsesTheCutoffForBlend)
{
    CardFile card;
    BakeOptions bake;
    bake.level = 4;
    bake.cutoff = 0.25;
    card.bake(bake);
    card.material = R"("alphaMode": "BLEND")";
    FileOptions options;
    options.blendCutoff = 0.25;
    EXPECT_EQ(verifyCard(card, options).counts().of(Kind::Wrong), 0u);
    EXPECT_EQ(verifyCard(card, options).counts().of(Kind::OutsideMargins), 0u);
    options.blendCutoff = 0.75;
    const FileReport report = verifyCard(card, options);
    EXPECT_GT(report.counts().of(Kind::Wrong), 0u);
    EXPECT_EQ(report.primitives[0].cutoff, 0.75);
}

TEST(VerifyFile, VertexAlphaScalesTheTexture)
{
    CardFile card = cardOf(State::Transparent);
    EXPECT_EQ(verifyCard(card).counts().of(Kind::Wrong), 2u);
    card.alphas = {0.25f, 0.25f, 0.25f, 0.25f};
    EXPECT_EQ(verifyCard(card).counts().of(Kind::Wrong), 0u);
    card.alphas = {0.25f, 1, 0.25f, 0.25f}; // of the first triangle alone
    const FileReport report = verifyCard(card);
    ASSERT_EQ(report.primitives[0].result.findings.size(), 1u);
    EXPECT_EQ(report.primitives[0].result.findings[0].triangle, 0u);
}

TEST(VerifyFile, DoesNotLookAtClaimsOfABrokenStructure)
{
    CardFile card = bakedCard();
    card.usageCounts = "[3]";
    const FileReport report = verifyCard(card);
    EXPECT_GE(report.findings.size(), 1u);
    EXPECT_TRUE(report.primitives.empty());
}

TEST(VerifyFile, ReportsWhatItCannotVerify)
{
    CardFile card = bakedCard();
    card.textured = false;
    FileReport report = verifyCard(card);
    EXPECT_TRUE(report.primitives.empty());
    ASSERT_EQ(report.unverified.size(), 1u);
    EXPECT_EQ(report.unverified[0].name, "mesh 0 \"leaves\" primitive 0");
    EXPECT_NE(report.unverified[0].reason.find("TEXCOORD_0"), std::string::npos);

    // A file that is not an image.
    card = bakedCard();
    Bytes bytes = card.bytes();
    const std::string signature = "\x89PNG";
    const auto found = std::search(bytes.begin(), bytes.end(), signature.begin(), signature.end(),
                                   [](uint8_t a, char b) { return a == static_cast<uint8_t>(b); });
    ASSERT_NE(found, bytes.end());
    *found = 0;
    const TemporaryFolder folder;
    writeFile(folder / "card.glb", bytes);
    report = verify::verifyDocument(Document(folder / "card.glb"), {});
    ASSERT_EQ(report.unverified.size(), 1u);
    EXPECT_NE(report.unverified[0].reason.find("image 0"), std::string::npos);
    EXPECT_EQ(report.unverified[0].reason.find("card.glb"), std::string::npos);
}

TEST(VerifyFile, AFileWithoutMicromapsHasNothingToVerify)
{
    CardFile card;
    card.extension = false;
    const FileReport report = verifyCard(card);
    EXPECT_TRUE(report.stored.extension.empty());
    EXPECT_TRUE(report.findings.empty());
    EXPECT_TRUE(report.primitives.empty());
}

// Then all of it is an approximation.
TEST(VerifyFile, SpecialIndicesBesideDataOfTwoStates)
{
    CardFile card = cardOf(State::Transparent);
    EXPECT_EQ(verifyCard(card).counts().of(Kind::Wrong), 2u);
    BakeOptions options;
    options.level = 2;
    options.format = Format::TwoState;
    card.bake(options);
    card.micromap.indices = {specialIndex(State::Transparent), specialIndex(State::UnknownOpaque)};
    const verify::Counts counts = verifyCard(card).counts();
    EXPECT_EQ(counts.of(Kind::Wrong), 0u);
    EXPECT_EQ(counts.twoStateMixed, 1u);
    EXPECT_EQ(counts.unknown, 1u);
    FileOptions strict;
    strict.strictTwoState = true;
    EXPECT_EQ(verifyCard(card, strict).counts().of(Kind::Wrong), 1u);
}

// At level 0 all of the card is one state; its micromap has no other triangle that says so.
TEST(VerifyFile, FindsNothingInACardOfTwoStatesAtAnyLevel)
{
    CardFile card;
    card.extension = false;
    const TemporaryFolder folder;
    writeFile(folder / "card.glb", card.bytes());
    for (const uint32_t level : {0u, 1u, 2u, 5u}) {
        FileBakeOptions options;
        options.bake.level = level;
        options.bake.format = Format::TwoState;
        options.measure = true;
        const FileBake bake = bakeFile(folder / "card.glb", folder / "baked.glb", options);
        ASSERT_TRUE(bake.surface);
        EXPECT_DOUBLE_EQ(bake.surface->twoStates, 1);
        const FileReport report = verify::verifyDocument(Document(folder / "baked.glb"), {});
        EXPECT_EQ(report.counts().of(Kind::Wrong), 0u) << level;
        EXPECT_GT(report.counts().twoStateMixed, 0u) << level;
    }
}

TEST(VerifyFile, ReportsWhatADeviceMustHave)
{
    CardFile card = bakedCard();
    card.micromap.indices[0] = specialIndex(State::UnknownOpaque);
    EXPECT_TRUE(verifyCard(card).mixedSpecialIndices);
    EXPECT_EQ(verifyCard(card).primitives[0].special, 1u);
    BakeOptions options;
    options.level = 2;
    options.format = Format::TwoState;
    card.bake(options);
    EXPECT_EQ(verifyCard(card).level2State, 2);
    EXPECT_EQ(verifyCard(card).level4State, -1);
}

// Primitives that are the same and say the same are looked at once.
TEST(VerifyFile, LooksAtTheSameOnce)
{
    CardFile card = bakedCard();
    const FileReport one = verifyCard(card);
    card.cards = 50;
    const FileReport many = verifyCard(card);
    ASSERT_EQ(many.primitives.size(), 50u);
    EXPECT_EQ(many.work, one.work);
    EXPECT_EQ(many.counts().microTriangles(), 50 * one.counts().microTriangles());
}

// A file cannot request more than a bounded amount of work.
TEST(VerifyFile, LeavesOpenWhatTakesTooLong)
{
    CardFile card = bakedCard(8);
    FileOptions options;
    options.fileWork = 100;
    options.workForByte = 0;
    FileReport report = verifyCard(card, options);
    ASSERT_EQ(report.primitives.size(), 1u);
    EXPECT_GT(report.counts().open, 0u);
    for (const unsigned threads : {1u, 3u}) {
        options.threads = threads;
        EXPECT_EQ(verifyCard(card, options).counts().open, report.counts().open);
    }
    options.fileWork = 0;
    report = verifyCard(card, options);
    ASSERT_EQ(report.unverified.size(), 1u);
    EXPECT_EQ(report.unverified[0].reason, "the file takes too long to verify");
}

TEST(VerifyFile, CautionsOfAnotherImage)
{
    Bytes bytes = bakedCard().bytes();
    EXPECT_EQ(verifyCard(bakedCard()).primitives.at(0).caution, "");
    uint32_t length = 0;
    std::memcpy(&length, &bytes[12], sizeof length);
    std::string json(bytes.begin() + 20, bytes.begin() + 20 + length);
    const std::string texture = R"("textures": [{"source": 0)";
    json.insert(json.find(texture) + texture.size(), R"(, "extensions": {"KHR_texture_basisu": {"source": 0}})");
    const TemporaryFolder folder;
    writeFile(folder / "card.glb", packGlb(json, Bytes(bytes.begin() + 28 + length, bytes.end())));
    const FileReport report = verify::verifyDocument(Document(folder / "card.glb"), {});
    EXPECT_EQ(report.primitives.at(0).caution, "its texture has an image that is not supported (KHR_texture_basisu)");
}

// The image by the extension is verified, of whatever depth, and those who do not know it may take another.
TEST(VerifyFile, AvifTextures)
{
    if (!kDecodesWebpAndAvif)
        GTEST_SKIP() << "this build has no libavif";
    const Image disc = decodeImage(discPng(), "disc");
    Bytes bytes = bakedCard().bytes();
    uint32_t length = 0;
    std::memcpy(&length, &bytes[12], sizeof length);
    std::string json(bytes.begin() + 20, bytes.begin() + 20 + length);
    const std::string texture = R"("textures": [{"source": 0)";
    json.insert(json.find(texture) + texture.size(), R"(, "extensions": {"EXT_texture_avif": {"source": 1}})");
    json.insert(json.find(R"(], "accessors")"), R"(, {"uri": "disc.avif"})");
    const TemporaryFolder folder;
    writeFile(folder / "card.glb", packGlb(json, Bytes(bytes.begin() + 28 + length, bytes.end())));
    for (const unsigned depth : {8u, 10u, 12u})
        for (const bool same : {true, false}) {
            std::vector<uint16_t> rgba;
            for (const uint8_t value : disc.rgba)
                rgba.push_back(static_cast<uint16_t>((value != 0) == same ? (1u << depth) - 1 : 0));
            writeFile(folder / "disc.avif", avifImage(disc.width, disc.height, rgba, {.depth = depth}));
            const FileReport report = verify::verifyDocument(Document(folder / "card.glb"), {});
            ASSERT_EQ(report.primitives.size(), 1u);
            EXPECT_EQ(report.primitives[0].caution,
                      "its texture has another image for those who do not know EXT_texture_avif");
            EXPECT_EQ(report.counts().of(Kind::Wrong) == 0, same) << depth;
        }
}

// The baker gives up triangles whose vertices have different alphas, or alphas that no texture has. It can be proven
// that they need not be unknown, but that is not a finding in a file that was just baked.
TEST(VerifyFile, FindsNothingInABakedFileWithVertexAlphas)
{
    for (const std::vector<float> &alphas : {std::vector<float>{1, 1, 1, 1},
                                             {0.25f, 0.5f, 0.375f, 0.125f},
                                             {0.1f, 0.1f, 0.1f, 0.2f},
                                             {0, 0, 0, 0.25f},
                                             {2, 2, 2, 2},
                                             {0.75f, 0.75f, 0.75f, 0.75f},
                                             {1, 0.9f, 0.8f, 1}}) {
        const FileReport report = verifyBaked(alphas);
        ASSERT_EQ(report.primitives.size(), 1u);
        for (size_t kind = 0; kind < verify::kKinds; ++kind)
            EXPECT_EQ(report.counts().findings[kind], 0u) << kind << ' ' << alphas[0];
    }
    // Whole triangles do count where one alpha decides them, and alpha 0 is decided without the texture.
    for (const auto &[alpha, needless] : {std::pair{0.25f, 2u}, {0.0f, 2u}, {2.0f, 0u}}) {
        CardFile unknown = cardOf(State::UnknownOpaque);
        unknown.alphas = std::vector<float>(4, alpha);
        EXPECT_EQ(verifyCard(unknown).counts().of(Kind::Needless), needless) << alpha;
    }
    // The baker decides the 16 most frequent alphas of a micromap.
    for (const unsigned cards : {16u, 17u}) {
        CardFile unknown = cardOf(State::UnknownOpaque);
        unknown.cards = cards;
        for (unsigned i = 0; i < 4 * cards; ++i)
            unknown.alphas.push_back(static_cast<float>(i / 4 + 1) / 64);
        EXPECT_EQ(verifyCard(unknown).counts().of(Kind::Needless), cards == 16 ? 32u : 0u);
    }
    // Micro-triangles of such a triangle that are unknown one by one do count.
    CardFile card = bakedCard();
    card.alphas = {0.25f, 0.25f, 0.25f, 0.125f};
    std::fill(card.micromap.data.begin(), card.micromap.data.end(), uint8_t{0xff});
    EXPECT_EQ(verifyCard(card).counts().of(Kind::Needless), 2 * microTriangleCount(3));
}

// Materials that read the same texture, each with its own cutoff: the file of the image is gone before the second.
TEST(VerifyFile, ReadsAnImageOnceForAllMaterials)
{
    const TemporaryFolder folder;
    std::string json =
        writeCardGltf(folder / "tree.gltf", discPng(),
                      {{R"({"attributes": {"POSITION": 0, "TEXCOORD_0": 1}, "indices": 2, "material": 0})",
                        R"({"attributes": {"POSITION": 0, "TEXCOORD_0": 1}, "indices": 2, "material": 0},
             {"attributes": {"POSITION": 0, "TEXCOORD_0": 1}, "indices": 2, "material": 2})"},
                       {R"({"name": "wood"})", R"({"name": "wood"}, {"alphaMode": "MASK", "alphaCutoff": 0.7,
             "pbrMetallicRoughness": {"baseColorFactor": [1, 1, 1, 0.75], "baseColorTexture": {"index": 0}}})"}});
    FileBakeOptions bake;
    bake.bake.level = 3;
    bakeFile(folder / "tree.gltf", folder / "baked.gltf", bake);
    FileOptions options;
    options.progress = [&](size_t, size_t) { std::filesystem::remove(folder / "disc.png"); };
    const FileReport report = verify::verifyDocument(Document(folder / "baked.gltf"), options);
    EXPECT_TRUE(report.unverified.empty()) << report.unverified[0].reason;
    EXPECT_EQ(report.primitives.size(), 2u);
}
