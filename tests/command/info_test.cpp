// SPDX-License-Identifier: Apache-2.0
// `vellum info`: its output about this machine and about files, and its exit code on errors.
#include <cstring>
#include <fstream>

#include "rendering.h"

using namespace vellum::test;

namespace
{

class Info : public testing::Test
{
protected:
    void write(const std::string &name, const std::string &text) const
    {
        writeFile(folder / name, Bytes(text.begin(), text.end()));
    }
    // A folder with a manifest of the layer that names this library.
    [[nodiscard]] std::string layerFolder(const std::string &library) const
    {
        write("layer.json", R"({"file_format_version": "1.2.0", "layer": {"name": "VK_LAYER_VELLUM_opacity_micromap",
              "type": "GLOBAL", "api_version": "1.3.239", "implementation_version": "1", "description": "",
              "library_path": ")" +
                                library + "\"}}");
        return folder.path().string();
    }
    // The one line on stderr of what must fail.
    static std::string problem(const Outcome &outcome)
    {
        EXPECT_EQ(outcome.exitCode, 1) << outcome.output;
        EXPECT_EQ(outcome.errorLines(), 1) << outcome.errors;
        return outcome.errors;
    }
    [[nodiscard]] std::string in(const std::string &name) const { return (folder / name).string(); }

    TemporaryFolder folder;
};

} // namespace

TEST_F(Info, SaysWhoBringsMicromapsAndHowToTurnThemOn)
{
    const Outcome outcome = runVellum({"info"});
    EXPECT_EQ(outcome.exitCode, 0) << outcome.errors;
    EXPECT_EQ(outcome.errors, "");
    EXPECT_TRUE(has(outcome.output, "VK_KHR_opacity_micromap: emulated by the layer")) << outcome.output;
    EXPECT_TRUE(has(outcome.output, "export VK_INSTANCE_LAYERS=VK_LAYER_VELLUM_opacity_micromap")) << outcome.output;
    EXPECT_TRUE(has(outcome.output, "subdivision level 12 with 2 states")) << outcome.output;

    // The printed variables work: with them the loader finds the layer and it is turned on.
    const std::string line = lineOf(outcome, "turn it on");
    const size_t at = line.find("VK_ADD_LAYER_PATH=");
    ASSERT_NE(at, std::string::npos) << outcome.output;
    const Outcome after = runVellum({"info"}, {{"VK_ADD_LAYER_PATH", line.substr(at + 18)},
                                               {"VK_INSTANCE_LAYERS", "VK_LAYER_VELLUM_opacity_micromap"}});
    EXPECT_EQ(after.exitCode, 0) << after.errors;
    EXPECT_TRUE(has(after.output, "the loader finds it, and it is turned on")) << after.output;
    EXPECT_FALSE(has(after.output, "export ")) << after.output;
}

TEST_F(Info, JsonSaysTheSame)
{
    const Outcome outcome = runVellum({"info", "--json"});
    EXPECT_EQ(outcome.exitCode, 0) << outcome.errors;
    EXPECT_TRUE(has(outcome.output, "\"VK_EXT_opacity_micromap\": \"emulated\"")) << outcome.output;
    EXPECT_TRUE(has(outcome.output, "\"problems\": []")) << outcome.output;
}

TEST_F(Info, DriversThatCannotWork)
{
    EXPECT_EQ(problem(runVellum({"info"}, {{"VK_DRIVER_FILES", in("none.json")}})),
              "vellum: the driver's manifest " + in("none.json") + ": it does not exist\n");
    EXPECT_EQ(problem(runVellum({"info"}, {{"VK_DRIVER_FILES", ""}})),
              "vellum: VK_DRIVER_FILES is set, so that the loader looks nowhere else, and names no driver\n");
    write("text.json", "hello");
    EXPECT_TRUE(has(problem(runVellum({"info"}, {{"VK_DRIVER_FILES", in("text.json")}})), "it is not a manifest"));
    write("icd.json", R"({"file_format_version": "1.0.0",
                          "ICD": {"library_path": "./libnone.so", "api_version": "1.3.0"}})");
    EXPECT_EQ(problem(runVellum({"info"}, {{"VK_DRIVER_FILES", in("icd.json")}})),
              "vellum: the driver's manifest " + in("icd.json") + ": its library " + in("libnone.so") +
                  " does not exist\n");
}

TEST_F(Info, LayersThatCannotWork)
{
    const std::string manifest = "vellum: the layer's manifest " + in("layer.json") + ": its library ";
    const std::string path = layerFolder("./liblayer.so");
    EXPECT_EQ(problem(runVellum({"info", "--layer-path", path})), manifest + in("liblayer.so") + " does not exist\n");
    write("liblayer.so", "not a library at all");
    EXPECT_EQ(problem(runVellum({"info", "--layer-path", path})),
              manifest + in("liblayer.so") + " is not a shared library, or cannot be read\n");

    Bytes header = readFile("/proc/self/exe");
    header.resize(4096);
    header[18] = static_cast<uint8_t>(header[18] + 1); // e_machine
    writeFile(folder / "liblayer.so", header);
    EXPECT_EQ(problem(runVellum({"info", "--layer-path", path})),
              manifest + in("liblayer.so") + " is for another kind of processor than this program\n");

    const TemporaryFolder empty;
    EXPECT_EQ(problem(runVellum({"info", "--layer-path", empty.path().string()})),
              "vellum: there is no manifest of the layer, neither where the loader looks nor in " +
                  empty.path().string() + "\n");
}

TEST_F(Info, FilesBeforeAndAfterABake)
{
    writeFile(folder / "card.glb", cardGlb());
    const Outcome before = runVellum({"info", in("card.glb")});
    EXPECT_EQ(before.exitCode, 0) << before.errors;
    EXPECT_EQ(lineOf(before, "triangles"), "triangles   3, of which 2 are alpha-masked");
    EXPECT_EQ(lineOf(before, "image 0"), "image 0     16 x 16, PNG, " + std::to_string(discPng().size()) + " bytes");
    EXPECT_EQ(lineOf(before, "micromaps"), "micromaps   none");
    EXPECT_TRUE(has(before.output, "materials   1 MASK: leaf\n")) << before.output;

    ASSERT_EQ(runVellum({"bake", in("card.glb"), "--level", "4"}).exitCode, 0);
    const Outcome after = runVellum({"info", in("card.omm.glb")});
    EXPECT_EQ(after.exitCode, 0) << after.errors;
    EXPECT_EQ(lineOf(after, "micromaps"), "micromaps   1 by EXT_mesh_opacity_micromap, on 1 primitive");
    EXPECT_TRUE(has(lineOf(after, "micromap 0"), "of level 4 with 4 states")) << after.output;
}

TEST_F(Info, FilesThatAreWrong)
{
    writeFile(folder / "card.glb", cardGlb({{", \"TEXCOORD_0\": 1", ""}}));
    const Outcome left = runVellum({"info", in("card.glb")});
    EXPECT_EQ(lineOf(left, "skipped").find("skipped     mesh 0 primitive 0 (leaf): "), 0u) << left.output;
    writeFile(folder / "cut.glb", Bytes(10));
    writeFile(folder / "index.glb", cardGlb({{"\"indices\": 2", "\"indices\": 20"}}));
    const Outcome wrong = runVellum({"info", in("cut.glb"), in("index.glb")});
    EXPECT_EQ(wrong.exitCode, 1);
    EXPECT_EQ(wrong.errorLines(), 1) << wrong.errors; // the other file is reported nevertheless
    EXPECT_TRUE(has(wrong.output, "unreadable  mesh 0 primitive 0: ")) << wrong.output;
}
