// SPDX-License-Identifier: Apache-2.0
// Selection of primitives to bake, and the textures that they are baked with.
#include "gltf/micromaps/document_bake.h"

#include <algorithm>
#include <array>
#include <cstring>
#include <gtest/gtest.h>

#include "compressed.h"
#include "gltf/alpha_textures.h"
#include "gltf/data/image.h"
#include "gltf/primitive.h"

using namespace vellum;
using namespace vellum::test;

namespace
{

DocumentBakeOptions optionsOf(uint32_t level = 4)
{
    DocumentBakeOptions options;
    options.bake.level = level;
    return options;
}

DocumentBake bakeCard(const Replacements &replacements, const DocumentBakeOptions &options = optionsOf())
{
    const TemporaryFolder folder;
    writeFile(folder / "test.glb", cardGlb(replacements));
    return bakeDocument(Document(folder / "test.glb"), options);
}

// The one reason for which the card is left.
std::string reasonFor(const Replacements &replacements, const DocumentBakeOptions &options = optionsOf())
{
    const DocumentBake bake = bakeCard(replacements, options);
    EXPECT_TRUE(bake.micromaps.empty());
    EXPECT_TRUE(bake.primitives.empty());
    return bake.skipped.size() == 1 ? bake.skipped[0].reason : "none";
}

const std::string kAsset = R"("asset": {"version": "2.0"},)";

// The card with COLOR_0, whose alphas these are.
DocumentBake bakeColored(const std::array<float, 4> &alphas, const DocumentBakeOptions &options = optionsOf(),
                         const std::string &cutoff = "0.25")
{
    const Bytes card = cardGlb({{R"("TEXCOORD_0": 1})", R"("TEXCOORD_0": 1, "COLOR_0": 4})"},
                                {"\"alphaCutoff\": 0.25", "\"alphaCutoff\": " + cutoff},
                                {R"("count": 3, "type": "VEC3"}],)",
                                 R"("count": 3, "type": "VEC3"},
                                 {"bufferView": 4, "componentType": 5126, "count": 4, "type": "VEC4"}],)"},
                                {"\"bufferViews\": [", "\"bufferViews\": [COLORS"}});
    uint32_t length = 0;
    std::memcpy(&length, &card[12], sizeof length);
    std::string json(card.begin() + 20, card.begin() + 20 + length);
    json.resize(json.find_last_not_of(' ') + 1);
    json.erase(json.find("COLORS"), 6);
    const size_t end = json.find("],\n\"buffers\"");
    json.insert(end, R"(, {"buffer": 1, "byteLength": 64})");
    std::string base64;
    Bytes bytes;
    for (const float alpha : alphas) {
        const std::array<float, 4> color = {1, 1, 1, alpha};
        const size_t old = bytes.size();
        bytes.resize(old + sizeof color);
        std::memcpy(bytes.data() + old, color.data(), sizeof color);
    }
    bytes.resize(66);
    for (size_t i = 0; i < bytes.size(); i += 3) {
        const auto word = static_cast<unsigned>(bytes[i] << 16 | bytes[i + 1] << 8 | bytes[i + 2]);
        for (int shift = 18; shift >= 0; shift -= 6)
            base64 += "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/"[word >> shift & 63];
    }
    json.resize(json.size() - 2);
    json += R"(, {"uri": "data:application/octet-stream;base64,)" + base64 + R"(", "byteLength": 66}]})";
    const TemporaryFolder folder;
    writeFile(folder / "test.glb", packGlb(json, {card.begin() + 28 + length, card.end()}));
    return bakeDocument(Document(folder / "test.glb"), options);
}

// The result of the baker alone for the card's two triangles, with this cutoff.
Micromap bakeDirectly(double cutoff, BakeOptions options = optionsOf().bake)
{
    const TemporaryFolder folder;
    writeFile(folder / "test.glb", cardGlb());
    const Document document(folder / "test.glb");
    const Material material = readMaterial(document, 0);
    options.cutoff = cutoff;
    const Image image = readImage(document, 0);
    return bake(alphaTexture(material, image), triangleUvs(readPrimitive(document, {0, 0}, Positions::Skip)), options)
        .micromap;
}

void expectSame(const DocumentBake &bake, const Micromap &expected)
{
    ASSERT_EQ(bake.micromaps.size(), 1u);
    EXPECT_EQ(bake.micromaps[0].data, expected.data);
    EXPECT_EQ(bake.micromaps[0].usage, usageOf(expected.triangles));
    ASSERT_EQ(bake.primitives.size(), 1u);
    EXPECT_EQ(bake.primitives[0].micromap.indices, expected.indices);
}

} // namespace

TEST(DocumentBake, EqualsADirectBake)
{
    const DocumentBake bake = bakeCard({});
    expectSame(bake, bakeDirectly(0.25));
    EXPECT_EQ(bake.primitives[0].place, (PrimitivePlace{0, 0}));
    EXPECT_EQ(bake.primitives[0].material, "leaf");
    EXPECT_TRUE(bake.skipped.empty());
    // No texel exceeds the base colour's 0.75.
    EXPECT_NE(bakeDirectly(0.25).indices, bakeDirectly(0.9).indices);
}

TEST(DocumentBake, BlendOnRequest)
{
    const Replacements blend = {{"MASK", "BLEND"}};
    EXPECT_EQ(reasonFor(blend), "its alphaMode is BLEND");
    DocumentBakeOptions options = optionsOf();
    options.blend = true;
    // Only an alpha of 0 is known: the factor of the base colour is 0.75.
    const DocumentBake blended = bakeCard(blend, options);
    std::array<size_t, 4> states{};
    for (const MicromapTriangle &t : blended.micromaps.at(0).triangles)
        for (uint32_t i = 0; i < microTriangleCount(t.subdivisionLevel); ++i)
            ++states[static_cast<size_t>(readState(&blended.micromaps[0].data[t.dataOffset], i, t.format))];
    EXPECT_GT(states[static_cast<size_t>(State::Transparent)], 10u);
    EXPECT_EQ(states[static_cast<size_t>(State::Opaque)], 0u);
    EXPECT_EQ(blended.primitives.at(0).caution, "");
    options.blendCutoff = 0.5f;
    expectSame(bakeCard(blend, options), bakeDirectly(0.5));
    options.blendCutoff = 0.875f;
    EXPECT_EQ(bakeCard(blend, options).primitives.at(0).micromap.indices, bakeDirectly(0.875).indices);
}

TEST(DocumentBake, SkipsExcludedNames)
{
    DocumentBakeOptions options = optionsOf();
    options.excludedMaterials = {"wood", "l??f"};
    EXPECT_EQ(reasonFor({}, options), "it is excluded");
    options.excludedMaterials = {"lea"};
    options.excludedMeshes = {"tree*"};
    EXPECT_EQ(bakeCard({}, options).primitives.size(), 1u);
    EXPECT_EQ(reasonFor({{"{\"primitives\"", "{\"name\": \"tree 7\", \"primitives\""}}, options), "it is excluded");
    options.excludedMaterials = {"*end"};
    EXPECT_EQ(reasonFor({{"\"leaf\"", '"' + std::string(1000, 'x') + "end\""}}, options), "it is excluded");
}

// Textures of materials that are not baked may have any extension.
TEST(DocumentBake, NeedsNoTextureOfWhatIsNotBaked)
{
    const Replacements::value_type unknown = {R"({"source": 0, "sampler": 0})",
                                              R"({"extensions": {"ACME_video": {"source": 0}}})"};
    const auto codeOf = [](const Replacements &replacements, const DocumentBakeOptions &options) {
        const DocumentBake bake = bakeCard(replacements, options);
        return bake.skipped.size() == 1 ? bake.skipped[0].code : SkipReason::NoTriangles;
    };
    DocumentBakeOptions options = optionsOf();
    EXPECT_EQ(codeOf({unknown}, options), SkipReason::Unsupported);
    EXPECT_EQ(codeOf({unknown, {"\"MASK\"", "\"BLEND\""}}, options), SkipReason::AlphaModeBlend);
    options.excludedMaterials = {"leaf"};
    EXPECT_EQ(codeOf({unknown}, options), SkipReason::Excluded);
    options.excludedMaterials = {};
    options.excludedMeshes = {""};
    EXPECT_EQ(codeOf({unknown}, options), SkipReason::Excluded);
}

TEST(DocumentBake, EqualAlphaSharesAMicromap)
{
    const DocumentBake bake = bakeCard({{R"({"attributes": {"POSITION": 3}, "material": 1})", kCardPrimitive}});
    ASSERT_EQ(bake.primitives.size(), 2u);
    EXPECT_EQ(bake.primitives[1].micromap.indices, bake.primitives[0].micromap.indices);
    EXPECT_EQ(bake.micromaps.size(), 1u);
    EXPECT_EQ(bake.micromaps[0].data, bakeDirectly(0.25).data);
    // Materials that differ in the cutoff get separate micromaps.
    const Replacements other = {
        {R"({"attributes": {"POSITION": 3}, "material": 1})",
         R"({"attributes": {"POSITION": 0, "TEXCOORD_0": 1}, "indices": 2, "material": 1})"},
        {R"({"name": "wood"})",
         R"({"name": "wood", "alphaMode": "MASK", "pbrMetallicRoughness": {"baseColorTexture": {"index": 0}}})"}};
    EXPECT_EQ(bakeCard(other).micromaps.size(), 2u);
    // Both share the budget.
    DocumentBakeOptions options = optionsOf();
    options.bake.budget = 100;
    const DocumentBake small = bakeCard(other, options);
    ASSERT_EQ(small.micromaps.size(), 2u);
    size_t bytes = 0;
    for (const StoredMicromap &micromap : small.micromaps)
        for (const MicromapTriangle &triangle : micromap.triangles)
            bytes += 8 + packedBytes(triangle.subdivisionLevel, triangle.format);
    EXPECT_LE(bytes, 100u);
    EXPECT_GT(bytes, 20u);
}

// Of two meshes with equal triangles, the larger one keeps what fits.
TEST(DocumentBake, ABudgetGoesToTheLargestSurface)
{
    for (const auto &[large, blended] : {std::pair{size_t{0}, false}, {size_t{1}, false}, {size_t{1}, true}}) {
        // A sky that is not baked has all of the surface, nearly.
        const std::string sky = blended ? R"(, "alphaMode": "BLEND"})" : "}";
        const std::string small = R"({"mesh": )" + std::to_string(1 - large) + "}";
        DocumentBakeOptions options = optionsOf();
        const Replacements meshes = {
            {R"(  {"attributes": {"POSITION": 3}, "material": 1}]}])",
             R"(  {"attributes": {"POSITION": 3}, "material": 2}]}, {"primitives": [)"
             R"({"attributes": {"POSITION": 0, "TEXCOORD_0": 1}, "indices": 2, "material": 1}]}, {"primitives": [)"
             R"({"attributes": {"POSITION": 3}, "material": 2}]}])"},
            {R"({"name": "wood"})",
             R"({"name": "other", "alphaMode": "MASK", "pbrMetallicRoughness": {"baseColorTexture":
                {"index": 0}}}, {"name": "sky")" +
                 sky},
            {R"("scenes": [{"nodes": [0]}])", R"("scenes": [{"nodes": [0, 1, 2]}])"},
            {R"({"mesh": 0, "translation": [0, 2, 0]})", small + R"(, {"scale": [20, 20, 20], "mesh": )" +
                                                             std::to_string(large) +
                                                             R"(}, {"scale": [1e5, 1e5, 1e5], "mesh": 2})"}};
        const auto bytesOf = [&](const DocumentBake &bake, size_t primitive) {
            return bake.micromaps.at(bake.primitives.at(primitive).micromap.micromap).bytes();
        };
        const DocumentBake whole = bakeCard(meshes, options);
        ASSERT_EQ(whole.micromaps.size(), 2u);
        const uint64_t all = bytesOf(whole, 0) + bytesOf(whole, 1);
        options.bake.budget = all;
        const DocumentBake same = bakeCard(meshes, options);
        for (size_t i = 0; i < 2; ++i)
            EXPECT_EQ(same.micromaps[i].data, whole.micromaps[i].data);
        // An empty micromap has 9 bytes.
        for (uint64_t budget = 18; budget < all; budget += all / 20) {
            options.bake.budget = budget;
            const DocumentBake some = bakeCard(meshes, options);
            EXPECT_LE(bytesOf(some, 0) + bytesOf(some, 1), budget);
        }
        options.bake.budget = bytesOf(whole, large) + 9;
        const DocumentBake bake = bakeCard(meshes, options);
        EXPECT_GT(bytesOf(bake, large), bytesOf(whole, large) * 3 / 4);
        EXPECT_LT(bytesOf(bake, 1 - large), bytesOf(whole, 1 - large) / 4);
    }
}

TEST(DocumentBake, AMaterialWithoutTextureIsOneStateAllOver)
{
    const Replacements bare = {{R"(, "baseColorTexture": {"index": 0})", ""}};
    const DocumentBake bake = bakeCard(bare); // alpha 0.75, cutoff 0.25
    ASSERT_EQ(bake.primitives.size(), 1u);
    EXPECT_EQ(bake.primitives[0].micromap.indices, (std::vector<int32_t>(2, specialIndex(State::Opaque))));
    // The extension wants a triangle in every micromap.
    EXPECT_EQ(bake.micromaps.at(0).triangles.size(), 1u);
}

TEST(DocumentBake, SkipsPrimitivesThatCannotBeBaked)
{
    EXPECT_EQ(reasonFor({{R"(, "TEXCOORD_0": 1)", ""}}), "it has no texture coordinates (TEXCOORD_0)");
    EXPECT_EQ(reasonFor({{kCardPrimitive, kCardPrimitive.substr(0, kCardPrimitive.size() - 1) +
                                              R"(, "extensions": {"KHR_materials_variants": {"mappings":
                                          [{"material": 1, "variants": [0]}]}}})"}}),
              "its material can be changed (KHR_materials_variants)");
    EXPECT_EQ(reasonFor({{R"("name": "leaf",)",
                          R"("name": "leaf", "extensions": {"KHR_materials_pbrSpecularGlossiness": {"a": 1}},)"}}),
              "its alpha comes from KHR_materials_pbrSpecularGlossiness");
    EXPECT_EQ(reasonFor({{R"("name": "leaf",)", R"("name": "leaf", "extensions": {"MSFT_lod": {"ids": [1]}},)"}}),
              "its material can be changed (MSFT_lod)");
    const auto animated = [](const std::string &pointer) {
        return Replacements{{kAsset, kAsset + R"("animations": [{"samplers": [{"input": 0, "output": 0}], "channels":
            [{"sampler": 0, "target": {"node": 0, "path": "pointer", "extensions": {"KHR_animation_pointer":
            {"pointer": ")" + pointer + R"("}}}}]}],)"}};
    };
    EXPECT_EQ(reasonFor(animated("/materials/0/alphaCutoff")),
              "its material's alpha is animated (KHR_animation_pointer)");
    EXPECT_EQ(reasonFor(animated("/materials/0/pbrMetallicRoughness/baseColorTexture/extensions/"
                                 "KHR_texture_transform/offset")),
              "its material's alpha is animated (KHR_animation_pointer)");
    EXPECT_EQ(bakeCard(animated("/materials/0/emissiveFactor")).primitives.size(), 1u);
    EXPECT_EQ(bakeCard(animated("/materials/1/alphaCutoff")).primitives.size(), 1u);
}

// The extension counts triangles by the indices, or else by the positions.
TEST(DocumentBake, MissingIndicesAndPositionsGiveNoTriangleCount)
{
    EXPECT_EQ(reasonFor({{kCardPrimitive, R"({"attributes": {"TEXCOORD_0": 1}, "material": 0})"}}),
              "it has neither indices nor positions");
    EXPECT_EQ(bakeCard({{kCardPrimitive, R"({"attributes": {"TEXCOORD_0": 1}, "indices": 2, "material": 0})"}})
                  .primitives.size(),
              1u);
}

// A renderer that reads the other image would sample that.
TEST(DocumentBake, FallbackImagesOnRequest)
{
    std::vector<std::string> unread = {"KHR_texture_basisu", "MSFT_texture_dds"};
    if (!kDecodesWebpAndAvif)
        unread.insert(unread.end(), {"EXT_texture_webp", "EXT_texture_avif"});
    for (const std::string &extension : unread) {
        const Replacements both = {
            {R"({"source": 0, "sampler": 0})",
             R"({"source": 0, "sampler": 0, "extensions": {")" + extension + R"(": {"source": 1}}})"},
            {R"("bufferView": 3}])", R"("bufferView": 3}, {"uri": "none"}])"}};
        EXPECT_EQ(reasonFor(both),
                  "its texture also has an image that is not supported (" + extension + "), which renderers may take");
        EXPECT_TRUE(bakeCard(both).skipped[0].hasFallback);
        DocumentBakeOptions options = optionsOf();
        options.fallbackImages = true;
        expectSame(bakeCard(both, options), bakeDirectly(0.25));
    }
}

// The texture's own image, or one by an extension, in the order in which three.js takes them. Two of the four
// extensions need decoders that this build may lack.
TEST(DocumentBake, ImageThatRenderersTake)
{
    struct Case {
        std::string texture;
        int image;
        std::string other, unread;
        int imageWithout; // the decoders
        std::string unreadWithout;
    };
    const std::string webp = "EXT_texture_webp";
    const std::string avif = "EXT_texture_avif";
    const std::string ktx = "KHR_texture_basisu";
    const auto by = [](const std::string &extension, int source) {
        return "\"" + extension + "\": {\"source\": " + std::to_string(source) + "}";
    };
    const auto only = [](const std::string &extensions) { return "\"extensions\": {" + extensions + "}"; };
    const auto also = [&](const std::string &extensions) { return "\"source\": 0, " + only(extensions); };
    for (const Case &c : std::vector<Case>{
             {"\"source\": 0", 0, "", "", 0, ""},
             {also(by(webp, 1)), 1, webp, "", 0, webp},
             {also(by(avif, 1)), 1, avif, "", 0, avif},
             {also(by(avif, 0)), 0, "", "", 0, avif},
             {only(by(avif, 1)), 1, "", "", 1, ""},
             {also(by(avif, 2) + ", " + by(webp, 1)), 1, webp, "", 0, avif},
             {only(by(avif, 2) + ", " + by(webp, 1)), 1, webp, "", 1, ""},
             {only(by(avif, 1) + ", " + by(webp, 1)), 1, "", "", 1, ""},
             {also(by(ktx, 1)), 0, "", ktx, 0, ktx},
             {also(by(ktx, 1) + ", " + by(avif, 2)), 2, avif, ktx, 0, ktx},
             {only(by(ktx, 1) + ", " + by(avif, 2)), 2, "", ktx, 2, ""},
             {only(by(ktx, 1)), 1, "", "", 1, ""},
         }) {
        const TemporaryFolder folder;
        writeFile(folder / "test.glb",
                  cardGlb({{R"({"source": 0, "sampler": 0})", "{" + c.texture + "}"},
                           {R"("bufferView": 3}])", R"("bufferView": 3}, {"uri": "1"}, {"uri": "2"}])"}}));
        const Material material = readMaterial(Document(folder / "test.glb"), 0);
        EXPECT_EQ(material.image, kDecodesWebpAndAvif ? c.image : c.imageWithout) << c.texture;
        EXPECT_EQ(material.otherImage, kDecodesWebpAndAvif ? c.other : "") << c.texture;
        EXPECT_EQ(material.unreadImage, kDecodesWebpAndAvif ? c.unread : c.unreadWithout) << c.texture;
    }
}

// Alpha of 8 bits as in the PNG, and more exact than that with more bits.
TEST(DocumentBake, AvifTextures)
{
    if (!kDecodesWebpAndAvif)
        GTEST_SKIP() << "this build has no libavif";
    const Image disc = decodeImage(discPng(), "disc");
    const Replacements texture = {
        {R"({"source": 0, "sampler": 0})", R"({"sampler": 0, "extensions": {"EXT_texture_avif": {"source": 1}}})"},
        {R"("bufferView": 3}])", R"("bufferView": 3}, {"uri": "disc.avif"}])"}};
    const TemporaryFolder folder;
    writeFile(folder / "test.glb", cardGlb(texture));
    const auto bake = [&](const std::vector<uint16_t> &rgba, unsigned depth, const DocumentBakeOptions &options) {
        writeFile(folder / "disc.avif", avifImage(disc.width, disc.height, rgba, {.depth = depth}));
        return bakeDocument(Document(folder / "test.glb"), options);
    };
    expectSame(bake({disc.rgba.begin(), disc.rgba.end()}, 8, optionsOf()), bakeDirectly(0.25));
    // The cutoff is a third, for a factor of 0.75. Of 8 bits, both values would be 85, a third as well.
    DocumentBakeOptions exact = optionsOf();
    exact.bake.exactly();
    for (const uint16_t alpha : {uint16_t{340}, uint16_t{342}}) {
        const DocumentBake result = bake(std::vector<uint16_t>(disc.rgba.size(), alpha), 10, exact);
        ASSERT_EQ(result.primitives.size(), 1u);
        for (const int32_t index : result.primitives[0].micromap.indices)
            EXPECT_EQ(index, specialIndex(alpha == 340 ? State::Transparent : State::Opaque)) << alpha;
    }
}

// Primitives that read a texture by different transforms have one micromap: their terms are part of its inputs only.
TEST(DocumentBake, TransformsOfOneTextureShareAMicromap)
{
    DocumentBakeOptions exact = optionsOf();
    exact.bake.exactly();
    // The texture repeats.
    const std::string moved = R"({"index": 0, "extensions": {"KHR_texture_transform": {"offset": [0, 4]}}})";
    const DocumentBake both =
        bakeCard({{R"({"attributes": {"POSITION": 3}, "material": 1})",
                   R"({"attributes": {"POSITION": 0, "TEXCOORD_0": 1}, "indices": 2, "material": 1})"},
                  {R"({"name": "wood"})", R"({"name": "moved", "alphaMode": "MASK", "alphaCutoff": 0.25,
                    "pbrMetallicRoughness": {"baseColorFactor": [1, 1, 1, 0.75], "baseColorTexture": )" +
                                              moved + "}}"}},
                 exact);
    const DocumentBake one = bakeCard({}, exact);
    ASSERT_EQ(both.primitives.size(), 2u);
    ASSERT_EQ(both.micromaps.size(), 1u);
    EXPECT_EQ(both.micromaps[0].bytes(), one.micromaps.at(0).bytes());
    for (const BakedPrimitive &primitive : both.primitives)
        EXPECT_EQ(primitive.micromap.indices, one.primitives.at(0).micromap.indices);
}

// The offset cancels out what makes the coordinates large: the sum is small, and a renderer's error is not.
TEST(DocumentBake, TransformsAreAsExactAsTheirTerms)
{
    const auto knownWith = [](float shift) {
        Bytes bytes =
            cardGlb({{R"("baseColorTexture": {"index": 0})",
                      R"("baseColorTexture": {"index": 0, "extensions": {"KHR_texture_transform": {"offset": [)" +
                          std::to_string(-shift) + ", 0]}}}"}});
        const std::array<float, 8> uvs = {0, 1, 1, 1, 1, 0, 0, 0};
        const auto *first = reinterpret_cast<const uint8_t *>(uvs.data());
        const auto found = std::search(bytes.begin(), bytes.end(), first, first + sizeof uvs);
        for (ptrdiff_t i = 0; i < 8; i += 2) {
            const float moved = uvs[static_cast<size_t>(i)] + shift;
            std::memcpy(&found[4 * i], &moved, sizeof moved);
        }
        const TemporaryFolder folder;
        writeFile(folder / "test.glb", bytes);
        const DocumentBake bake = bakeDocument(Document(folder / "test.glb"), optionsOf());
        size_t known = 0;
        for (const int32_t index : bake.primitives.at(0).micromap.indices) {
            if (const auto state = specialState(index)) {
                known += *state == State::Opaque || *state == State::Transparent ? 256u : 0u;
                continue;
            }
            const StoredMicromap &micromap = bake.micromaps.at(0);
            const MicromapTriangle &t = micromap.triangles.at(static_cast<size_t>(index));
            for (uint32_t i = 0; i < microTriangleCount(t.subdivisionLevel); ++i) {
                const State state = readState(&micromap.data[t.dataOffset], i, t.format);
                known += state == State::Opaque || state == State::Transparent ? 1u : 0u;
            }
        }
        return known;
    };
    EXPECT_GT(knownWith(0), 200u);
    EXPECT_EQ(knownWith(1), knownWith(0));
    EXPECT_LT(knownWith(65536), knownWith(0));
    EXPECT_EQ(knownWith(4194304), 0u);
}

TEST(DocumentBake, BakesOpaqueMaterialsWithAnyTexture)
{
    const DocumentBake bake = bakeCard({{R"("alphaMode": "MASK", )", ""}, {R"({"source": 0, "sampler": 0})", "{}"}});
    EXPECT_TRUE(bake.primitives.empty());
    EXPECT_TRUE(bake.skipped.empty());
    EXPECT_EQ(bakeCard({{R"({"source": 0, "sampler": 0})", "{}"}}).skipped.size(), 1u);
}

TEST(DocumentBake, ReportsWhatLosesItsMicromap)
{
    const Replacements stored = {
        {kCardPrimitive, kCardPrimitive.substr(0, kCardPrimitive.size() - 1) +
                             R"(, "extensions": {"EXT_mesh_opacity_micromap": {"micromap": 0}}})"}};
    DocumentBakeOptions options = optionsOf();
    EXPECT_TRUE(bakeCard(stored, options).skipped.empty());
    options.excludedMaterials = {"leaf"};
    EXPECT_TRUE(bakeCard(stored, options).skipped.at(0).hadMicromap);
    EXPECT_FALSE(bakeCard({}, options).skipped.at(0).hadMicromap);
}

TEST(DocumentBake, AVariantWithTheSameMaterialIsNoChange)
{
    EXPECT_EQ(bakeCard({{kCardPrimitive, kCardPrimitive.substr(0, kCardPrimitive.size() - 1) +
                                             R"(, "extensions": {"KHR_materials_variants": {"mappings":
                                         [{"material": 0, "variants": [0]}]}}})"}})
                  .primitives.size(),
              1u);
}

TEST(DocumentBake, ADamagedFileIsAnError)
{
    EXPECT_THROW(bakeCard({{R"("indices": 2)", R"("indices": 9)"}}), GltfError);
    EXPECT_THROW(
        bakeCard({{R"("mimeType": "image/png", "bufferView": 3)", R"("mimeType": "image/png", "bufferView": 9)"}}),
        GltfError);
}

TEST(DocumentBake, NumbersThatAreNone)
{
    // Below all doubles, and so 0: every alpha reaches it.
    const DocumentBake bake = bakeCard({{"\"alphaCutoff\": 0.25", "\"alphaCutoff\": 1e-400"}});
    EXPECT_EQ(bake.primitives.at(0).micromap.indices, std::vector<int32_t>(2, specialIndex(State::Opaque)));
    for (const char *wrong : {"1e400", "\"0.25\"", "null", "true", "{}"}) {
        const std::string number = wrong;
        EXPECT_THROW(bakeCard({{"\"alphaCutoff\": 0.25", "\"alphaCutoff\": " + number}}), GltfError) << number;
        EXPECT_THROW(bakeCard({{"0.25, 0.75]", "0.25, " + number + "]"}}), GltfError) << number;
        EXPECT_THROW(bakeCard({{"[1, 0.5, 0.25, 0.75]", number}}), GltfError) << number;
        for (const std::string &transform :
             {"\"offset\": [0, " + number + "]", "\"scale\": [" + number + ", 1]", "\"rotation\": " + number})
            EXPECT_THROW(bakeCard({{R"("baseColorTexture": {"index": 0})",
                                    R"("baseColorTexture": {"index": 0, "extensions": {"KHR_texture_transform": {)" +
                                        transform + "}}}"}}),
                         GltfError)
                << transform;
    }
}

TEST(DocumentBake, TheAlphaOfVerticesMultiplies)
{
    expectSame(bakeColored({1, 1, 1, 1}), bakeDirectly(0.25));
    // 0.25 / 0.25 is more than any texel has.
    EXPECT_EQ(bakeColored({0.25f, 0.25f, 0.25f, 0.25f}).primitives.at(0).micromap.indices, bakeDirectly(1).indices);
    EXPECT_NE(bakeDirectly(1).indices, bakeDirectly(0.25).indices);
    expectSame(bakeColored({0.5f, 0.5f, 0.5f, 0.5f}), bakeDirectly(0.5));
    EXPECT_EQ(bakeColored({1, 1, 1, 1}).primitives[0].varying, 0u);
}

TEST(DocumentBake, VaryingVertexAlphaIsUnknown)
{
    // Triangles 0 1 2 and 0 2 3.
    const DocumentBake bake = bakeColored({1, 1, 1, 0.5f});
    ASSERT_EQ(bake.primitives.size(), 1u);
    EXPECT_EQ(bake.primitives[0].micromap.indices[0], 0);
    EXPECT_EQ(bake.primitives[0].micromap.indices[1], specialIndex(State::UnknownOpaque));
    EXPECT_EQ(bake.primitives[0].varying, 1u);
    EXPECT_EQ(bakeColored({2, 2, 2, 2}).primitives[0].varying, 2u);
    EXPECT_EQ(bakeColored({-1, -1, -1, -1}).primitives[0].varying, 2u);
}

TEST(DocumentBake, FactorZeroIsTransparentForAnyTexture)
{
    const std::vector<int32_t> transparent(2, specialIndex(State::Transparent));
    const std::vector<int32_t> opaque(2, specialIndex(State::Opaque));
    EXPECT_EQ(bakeColored({0, 0, 0, 0}).primitives[0].micromap.indices, transparent);
    EXPECT_EQ(bakeColored({0, 0, 0, 0}, optionsOf(), "0.0").primitives[0].micromap.indices, opaque);
}

namespace
{

// Cards with the same texture, whose materials have a cutoff each.
void writeCards(const std::filesystem::path &path, size_t count)
{
    std::string primitives = kCardPrimitive;
    std::string materials;
    for (size_t i = 1; i < count; ++i) {
        primitives += R"(, {"attributes": {"POSITION": 0, "TEXCOORD_0": 1}, "indices": 2, "material": )" +
                      std::to_string(i + 1) + "}";
        materials +=
            R"(, {"alphaMode": "MASK", "alphaCutoff": 0.)" + std::to_string(10000 + i) +
            R"(, "pbrMetallicRoughness": {"baseColorFactor": [1, 1, 1, 0.75], "baseColorTexture": {"index": 0}}})";
    }
    writeCardGltf(path, discPng(),
                  {{kCardPrimitive, primitives}, {R"({"name": "wood"})", R"({"name": "wood"})" + materials}});
}

} // namespace

// The file of the image is gone before the second of them is baked.
TEST(DocumentBake, ReadsAnImageOnceForAllMaterials)
{
    for (const bool budget : {false, true}) {
        const TemporaryFolder folder;
        writeCards(folder / "tree.gltf", 3);
        DocumentBakeOptions options = optionsOf();
        if (budget)
            options.bake.budget = 1000;
        const DocumentBake expected = bakeDocument(Document(folder / "tree.gltf"), options);
        ASSERT_EQ(expected.micromaps.size(), 3u);
        options.bake.progress = [&](size_t, size_t) { std::filesystem::remove(folder / "disc.png"); };
        const DocumentBake bake = bakeDocument(Document(folder / "tree.gltf"), options);
        ASSERT_EQ(bake.micromaps.size(), 3u);
        for (size_t i = 0; i < 3; ++i) {
            EXPECT_EQ(bake.micromaps[i].data, expected.micromaps[i].data);
            EXPECT_EQ(bake.primitives[i].micromap.micromap, i);
        }
    }
}

// Readers of micromaps count triangles by indices or positions.
TEST(DocumentBake, SkipsTrianglesThatNothingCounts)
{
    const TemporaryFolder folder;
    writeCardGltf(folder / "card.gltf", discPng(),
                  {{kCardPrimitive, R"({"attributes": {"TEXCOORD_0": 1}, "material": 0})"}});
    const DocumentBake bake = bakeDocument(Document(folder / "card.gltf"), optionsOf());
    EXPECT_TRUE(bake.micromaps.empty());
    ASSERT_FALSE(bake.skipped.empty());
    EXPECT_EQ(bake.skipped[0].code, SkipReason::NoTriangles);
}

// Many small micromaps do not report more often than a large one.
TEST(DocumentBake, ReportsProgressAFewHundredTimes)
{
    const TemporaryFolder folder;
    writeCards(folder / "tree.gltf", 700);
    DocumentBakeOptions options = optionsOf();
    size_t calls = 0, last = 0;
    options.bake.progress = [&](size_t done, size_t total) {
        ++calls;
        EXPECT_GE(done, last);
        EXPECT_EQ(total, 1400u);
        last = done;
    };
    ASSERT_EQ(bakeDocument(Document(folder / "tree.gltf"), options).micromaps.size(), 700u);
    EXPECT_EQ(last, 1400u);
    EXPECT_LE(calls, 258u);
}

// Primitives that share their indices.
TEST(DocumentBake, TakesNoMoreTrianglesThanAFileCanHave)
{
    std::string primitives;
    for (int i = 0; i < 40; ++i)
        primitives +=
            std::string(i == 0 ? "" : ", ") + R"({"attributes": {"POSITION": 0}, "indices": 1, "material": 0})";
    const std::string json = R"({"asset": {"version": "2.0"}, "materials": [{"alphaMode": "MASK"}], "accessors": [
        {"componentType": 5126, "count": 3, "type": "VEC3"},
        {"bufferView": 0, "componentType": 5121, "count": 4194303, "type": "SCALAR"}],
        "buffers": [{"uri": "test.bin", "byteLength": 4194303}], "bufferViews": [{"buffer": 0, "byteLength": 4194303}],
        "meshes": [{"primitives": [)" +
                             primitives + "]}]}";
    const TemporaryFolder folder;
    writeFile(folder / "test.gltf", {json.begin(), json.end()});
    writeFile(folder / "test.bin", std::vector<uint8_t>(4194303));
    try {
        bakeDocument(Document(folder / "test.gltf"), optionsOf());
        ADD_FAILURE();
    } catch (const GltfError &error) {
        EXPECT_NE(std::string(error.what()).find("alpha-tested triangles"), std::string::npos) << error.what();
    }
}

TEST(ImageDecoder, DecodesNoMoreThanTheBytesCanBeWorth)
{
    const TemporaryFolder folder;
    writeFile(folder / "test.glb", cardGlb());
    const Document document(folder / "test.glb");
    constexpr uint64_t kTexels = 16 * 16;
    const uint64_t most = (uint64_t{1} << 27) + 8 * kMostTexelsPerByte * document.model().buffers[0].data.size();
    ImageDecoder decoder(document);
    EXPECT_EQ(decoder.decode(0).width, 16u);
    decoder.account(most - 2 * kTexels);
    EXPECT_EQ(decoder.decode(0).width, 16u);
    EXPECT_THROW(decoder.decode(0), GltfError);
}
