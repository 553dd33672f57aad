// SPDX-License-Identifier: Apache-2.0
// The scene graph: nodes, instances, skins and morph targets.
#include <cmath>
#include <cstring>

#include <gtest/gtest.h>

#include "glb_file.h"
#include "gltf/scene.h"

using namespace vellum;
using namespace vellum::test;

namespace
{

// A file of one mesh, a triangle in the plane z = 0, to which nodes and more data are added.
class SceneGraph : public testing::Test
{
private: // above what is initialized with it
    Bytes binary_;
    std::string accessors_, views_;
    int count_ = 0;

protected:
    // Adds data to the buffer and returns the number of its accessor.
    int add(const std::vector<float> &values, const char *type, size_t count)
    {
        return addBytes(values.data(), values.size() * sizeof(float), type, 5126, count);
    }
    int addJoints(const std::vector<uint8_t> &values)
    {
        return addBytes(values.data(), values.size(), "VEC4", 5121, values.size() / 4);
    }

    Scene read()
    {
        const std::string json = "{\"asset\": {\"version\": \"2.0\"}, \"meshes\": " + meshes + ", \"nodes\": " + nodes +
                                 ", " + more + "\"accessors\": [" + accessors_ + "], \"bufferViews\": [" + views_ +
                                 "], \"buffers\": [{\"byteLength\": " + std::to_string(binary_.size()) + "}]}";
        writeFile(folder / "test.glb", packGlb(json, binary_));
        return readGltf(folder / "test.glb");
    }
    std::string errorOf()
    {
        try {
            (void)read();
        } catch (const GltfError &error) {
            const std::string text = error.what();
            EXPECT_EQ(text.find('\n'), std::string::npos);
            return text.substr(text.find("test.glb: ") + 10);
        }
        return "none";
    }

    const int triangle = add({0, 0, 0, 1, 0, 0, 0, 1, 0}, "VEC3", 3);
    std::string meshes = R"([{"primitives": [{"attributes": {"POSITION": 0}}]}])";
    std::string nodes = R"([{"mesh": 0}])";
    std::string more = R"("scenes": [{"nodes": [0]}], )";
    TemporaryFolder folder;

private:
    int addBytes(const void *values, size_t bytes, const std::string &type, int component, size_t count)
    {
        const std::string comma = count_ == 0 ? "" : ", ";
        views_ += comma + "{\"buffer\": 0, \"byteOffset\": " + std::to_string(binary_.size()) +
                  ", \"byteLength\": " + std::to_string(bytes) + "}";
        accessors_ += comma + "{\"bufferView\": " + std::to_string(count_) +
                      ", \"componentType\": " + std::to_string(component) + ", \"count\": " + std::to_string(count) +
                      ", \"type\": \"" + type + "\"}";
        const size_t old = binary_.size();
        binary_.resize((old + bytes + 3) / 4 * 4);
        std::memcpy(binary_.data() + old, values, bytes);
        return count_++;
    }
};

Vec3 cornerOf(const Scene &scene, size_t instance, size_t vertex)
{
    const MeshInstance &i = scene.instances.at(instance);
    return transformed(i.transform, scene.geometries.at(scene.meshes.at(i.mesh).firstGeometry).positions.at(vertex));
}

void expectNear(const Vec3 &found, const Vec3 &expected)
{
    for (size_t i = 0; i < 3; ++i)
        EXPECT_NEAR(found[i], expected[i], 1e-5) << "coordinate " << i;
}

} // namespace

TEST_F(SceneGraph, AMeshOfSeveralNodesIsOneMesh)
{
    nodes = R"([{"children": [1, 2], "translation": [10, 0, 0]}, {"mesh": 0}, {"mesh": 0, "scale": [-2, 1, 1]}])";
    const Scene scene = read();
    ASSERT_EQ(scene.meshes.size(), 1u);
    ASSERT_EQ(scene.geometries.size(), 1u);
    ASSERT_EQ(scene.instances.size(), 2u);
    EXPECT_EQ(cornerOf(scene, 0, 1), (Vec3{11, 0, 0}));
    EXPECT_EQ(cornerOf(scene, 1, 1), (Vec3{8, 0, 0}));
    EXPECT_GT(determinant(scene.instances[0].transform), 0);
    EXPECT_DOUBLE_EQ(determinant(scene.instances[1].transform), -2);
}

TEST_F(SceneGraph, OnlyTheDefaultSceneIsRead)
{
    nodes = R"([{"mesh": 0}, {"mesh": 0, "translation": [1, 2, 3]}])";
    more = R"("scene": 1, "scenes": [{"nodes": [0]}, {"nodes": [1]}], )";
    const Scene scene = read();
    ASSERT_EQ(scene.instances.size(), 1u);
    EXPECT_EQ(cornerOf(scene, 0, 0), (Vec3{1, 2, 3}));
    more = "";
    EXPECT_EQ(read().instances.size(), 2u); // without scenes: all nodes
}

TEST_F(SceneGraph, ExtMeshGpuInstancing)
{
    const int moves = add({0, 0, 0, 0, 0, 5, 0, 0, 6}, "VEC3", 3);
    const float half = std::sqrt(0.5f);
    const int turns = add({0, 0, 0, 1, 0, 0, half, half, 0, 0, 0, 1}, "VEC4", 3);
    const int scales = add({1, 1, 1, 2, 2, 2, 3, 3, 3}, "VEC3", 3);
    nodes = "[{\"mesh\": 0, \"translation\": [100, 0, 0], \"extensions\": {\"EXT_mesh_gpu_instancing\": "
            "{\"attributes\": {\"TRANSLATION\": " +
            std::to_string(moves) + ", \"ROTATION\": " + std::to_string(turns) +
            ", \"SCALE\": " + std::to_string(scales) + "}}}}]";
    more += R"("extensionsUsed": ["EXT_mesh_gpu_instancing"], )";
    const Scene scene = read();
    ASSERT_EQ(scene.meshes.size(), 1u);
    ASSERT_EQ(scene.instances.size(), 3u);
    expectNear(cornerOf(scene, 0, 1), {101, 0, 0});
    expectNear(cornerOf(scene, 1, 1), {100, 2, 5}); // turned by a quarter about z
    expectNear(cornerOf(scene, 2, 1), {103, 0, 6});

    const int two = add({0, 0, 0, 0, 0, 0}, "VEC3", 2);
    nodes.replace(nodes.find("\"SCALE\": 3"), 10, "\"SCALE\": " + std::to_string(two));
    EXPECT_EQ(errorOf(), "node 0 EXT_mesh_gpu_instancing SCALE has 2 elements, another attribute has 3");
}

TEST_F(SceneGraph, MorphTargetsHaveTheirDefaultWeights)
{
    const int up = add({0, 0, 1, 0, 0, 1, 0, 0, 1}, "VEC3", 3);
    const int aside = add({4, 0, 0, 0, 0, 0, 0, 0, 0}, "VEC3", 3);
    meshes = "[{\"weights\": [0.5, 0], \"primitives\": [{\"attributes\": {\"POSITION\": 0}, \"targets\": "
             "[{\"POSITION\": " +
             std::to_string(up) + "}, {\"POSITION\": " + std::to_string(aside) + "}]}]}]";
    nodes = R"([{"children": [1, 2, 3]}, {"mesh": 0}, {"mesh": 0, "weights": [1, 0.25]}, {"mesh": 0}])";
    const Scene scene = read();
    ASSERT_EQ(scene.meshes.size(), 2u); // the node's own weights make another
    ASSERT_EQ(scene.instances.size(), 3u);
    EXPECT_EQ(cornerOf(scene, 0, 0), (Vec3{0, 0, 0.5f}));
    EXPECT_EQ(cornerOf(scene, 1, 0), (Vec3{1, 0, 1}));
    EXPECT_EQ(scene.instances[0].mesh, scene.instances[2].mesh);
    EXPECT_EQ(scene.geometries[1].place, (PrimitivePlace{0, 0}));
}

TEST_F(SceneGraph, SkinnedMeshesStandWhereTheirJointsAre)
{
    const int joints = addJoints({0, 1, 0, 0, 0, 1, 0, 0, 0, 1, 0, 0});
    const int weights = add({1, 0, 0, 0, 0, 1, 0, 0, 0.5f, 0.5f, 0, 0}, "VEC4", 3);
    // The second joint was bound a metre to the right.
    const int bind = add({1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0,  0, 0, 1, //
                          1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, -1, 0, 0, 1},
                         "MAT4", 2);
    meshes = "[{\"primitives\": [{\"attributes\": {\"POSITION\": 0, \"JOINTS_0\": " + std::to_string(joints) +
             ", \"WEIGHTS_0\": " + std::to_string(weights) + "}}]}]";
    nodes = R"([{"children": [1, 2, 3]}, {"mesh": 0, "skin": 0, "translation": [50, 50, 50]},
                {"translation": [0, 0, 7]}, {"translation": [1, 3, 0]}])";
    more += "\"skins\": [{\"joints\": [2, 3], \"inverseBindMatrices\": " + std::to_string(bind) + "}], ";
    const Scene scene = read();
    EXPECT_EQ(cornerOf(scene, 0, 0), (Vec3{0, 0, 7}));
    EXPECT_EQ(cornerOf(scene, 0, 1), (Vec3{1, 3, 0}));
    EXPECT_EQ(cornerOf(scene, 0, 2), (Vec3{0, 2.5f, 3.5f}));

    more.replace(more.find("[2, 3]"), 6, "[2]   ");
    EXPECT_EQ(errorOf(), "mesh 0 primitive 0: vertex 1 is moved by a joint that the skin does not have");
}

TEST_F(SceneGraph, RejectsCycles)
{
    nodes = R"([{"children": [1]}, {"mesh": 0, "children": [0]}])";
    EXPECT_EQ(errorOf(), "node 0 is used more than once");
    nodes = R"([{"children": [1, 1]}, {"mesh": 0}])";
    EXPECT_EQ(errorOf(), "node 1 is used more than once");
    nodes = "[";
    for (int i = 0; i < 1000; ++i)
        nodes += "{\"children\": [" + std::to_string(i + 1) + "]}, ";
    nodes += "{\"mesh\": 0}]";
    EXPECT_EQ(errorOf(), "the nodes are nested too deeply");
}

TEST_F(SceneGraph, InstancesAreBounded)
{
    // A thousand nodes with the same 2,000 places each.
    const int moves = add(std::vector<float>(6000), "VEC3", 2000);
    const std::string node = "{\"mesh\": 0, \"extensions\": {\"EXT_mesh_gpu_instancing\": {\"attributes\": "
                             "{\"TRANSLATION\": " +
                             std::to_string(moves) + "}}}}";
    nodes = "[" + node;
    std::string roots = "0";
    for (int i = 1; i < 1000; ++i) {
        nodes += ", " + node;
        roots += ", " + std::to_string(i);
    }
    nodes += "]";
    more = "\"scenes\": [{\"nodes\": [" + roots + "]}], ";
    EXPECT_EQ(errorOf(), "the scene has more than 1048576 instances of meshes");
}

TEST_F(SceneGraph, PlacesAreFinite)
{
    nodes = R"([{"mesh": 0, "translation": [1e39, 0, 0]}])";
    EXPECT_EQ(errorOf(), "node 0 stands at a place that is not finite");
    nodes = R"([{"mesh": 0, "scale": [3e38, 3e38, 3e38], "translation": [3e38, 0, 0]}])";
    EXPECT_EQ(errorOf(), "node 0 puts its mesh where positions are not finite");
}

// COLOR_0's alpha goes along, where it is not 1.
TEST_F(SceneGraph, VertexAlphas)
{
    const int colors = add({1, 1, 1, 0.5f, 1, 1, 1, 1, 1, 1, 1, 0}, "VEC4", 3);
    meshes = "[{\"primitives\": [{\"attributes\": {\"POSITION\": 0, \"COLOR_0\": " + std::to_string(colors) + "}}]}]";
    EXPECT_EQ(read().geometries[0].alphas, (std::vector<float>{0.5f, 1, 0}));
}
