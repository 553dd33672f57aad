// SPDX-License-Identifier: Apache-2.0
// Writes the seeds of each fuzz target that has some to a folder of its own. usage: fuzz_seed_maker LIST MODULES FOLDER
#include "seeds.h"

namespace
{

std::filesystem::path emptyFolder(const std::filesystem::path &folder)
{
    std::filesystem::remove_all(folder);
    std::filesystem::create_directories(folder);
    return folder;
}

} // namespace

int main(int argc, char **argv)
{
    if (argc != 4)
        return 2;
    const std::filesystem::path folder = argv[3];
    writeSpirvSeeds(argv[1], argv[2], emptyFolder(folder / "spirv_fuzz"));
    for (const char *target : {"gltf_fuzz", "inspect_fuzz"})
        writeGltfSeeds(emptyFolder(folder / target));
    return 0;
}
