// SPDX-License-Identifier: Apache-2.0
// Fuzz target of the glTF reader. Reading a file of any content ends soon and takes no more memory than its bytes can
// justify, and every error is reported as one GltfError.
//
// The first byte selects what the rest is: a whole file, the JSON of a file whose binary chunk is always the same, such
// a JSON with a part to repeat, an image, a Draco mesh, or a meshopt stream.
#include <cstring>
#include <string>

#include "check.h"
#include "gltf/data/decompress.h"
#include "gltf/data/image.h"
#include "gltf/file/gltf_error.h"
#include "gltf_input.h"
#include "read_everything.h"

using namespace vellum;
using namespace vellum::test;

namespace
{

void readFile(Input bytes)
{
    const MemoryFile file(bytes);
    const Reading reading = readEverything(file.path());
    for (const std::string &error : {reading.error, reading.unsupported}) {
        FUZZ_CHECK(error.empty() || error.starts_with(file.path().string() + ": "));
        FUZZ_CHECK(error.find('\n') == std::string::npos && error.size() < 1000);
    }
}

void readImage(Input bytes)
{
    const Image image = decodeImage(bytes, "image 0");
    FUZZ_CHECK(image.rgba.size() == size_t{4} * image.width * image.height && image.width != 0);
}

void readDraco(Input bytes)
{
    const DracoMesh mesh(bytes, "mesh 0 primitive 0");
    for (const uint32_t index : mesh.indices())
        FUZZ_CHECK(index < mesh.vertexCount());
    for (int64_t id = 0; id < 4; ++id) {
        const uint32_t components = std::min(mesh.components(id, "attribute"), 4u);
        FUZZ_CHECK(mesh.floats(id, components, DracoMesh::As::Unsigned16, "attribute").size() ==
                   components * mesh.vertexCount());
    }
}

void readMeshopt(Input bytes)
{
    if (bytes.size() < 4)
        return;
    const char *modes[] = {"ATTRIBUTES", "TRIANGLES", "INDICES"};
    const char *filters[] = {"NONE", "OCTAHEDRAL", "QUATERNION", "EXPONENTIAL"};
    CompressedView view;
    view.mode = modes[bytes[0] % 3];
    view.count = bytes[2] + 256u * (bytes[3] % 16);
    view.byteStride = 4 * (bytes[1] % 64 + 1u);
    if (view.mode != "ATTRIBUTES") {
        view.byteStride = 2 + 2 * (bytes[1] % 2u);
        view.count -= view.count % 3;
        view.filter = "NONE";
    } else {
        view.filter = filters[bytes[0] / 4 % 4];
        if (view.filter == "OCTAHEDRAL" || view.filter == "QUATERNION")
            view.byteStride = 8;
    }
    FUZZ_CHECK(decompressView(view, bytes.subspan(4)).size() == view.bytes());
}

} // namespace

extern "C" int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size)
{
    if (size == 0)
        return 0;
    // A copy of exactly that many bytes, so that AddressSanitizer sees the end.
    const Bytes copy(data + 1, data + size);
    try {
        switch (data[0] % 6) {
        case 0: readFile(copy); break;
        case 1: readFile(glbOf(copy)); break;
        case 2: readImage(copy); break;
        case 3: readDraco(copy); break;
        case 4: readMeshopt(copy); break;
        default: readFile(glbOf(repeated(copy))); break;
        }
    } catch (const GltfError &error) {
        FUZZ_CHECK(std::strlen(error.what()) > 0);
    }
    return 0;
}
