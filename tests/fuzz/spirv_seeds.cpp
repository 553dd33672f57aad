// SPDX-License-Identifier: Apache-2.0
#include "seeds.h"

#include <fstream>
#include <string>
#include <vector>

#include "spirv/module_file.h"

namespace
{

void write(const std::filesystem::path &module, const std::filesystem::path &seed)
{
    const std::vector<uint32_t> words = vellum::test::readModule(module);
    std::ofstream file(seed, std::ios::binary);
    file.exceptions(std::ios::failbit | std::ios::badbit);
    file.write(reinterpret_cast<const char *>(words.data()), static_cast<std::streamsize>(words.size() * 4));
}

} // namespace

void writeSpirvSeeds(const std::filesystem::path &list, const std::filesystem::path &modules,
                     const std::filesystem::path &folder)
{
    for (const std::filesystem::path &module : vellum::test::listedModules(list))
        write(module, folder / module.stem());
    for (const auto &entry : std::filesystem::directory_iterator(modules))
        if (entry.path().extension() == ".spv")
            write(entry.path(), folder / entry.path().stem());
}
