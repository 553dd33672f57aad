// SPDX-License-Identifier: Apache-2.0
// Writes the manual pages and the completions of shells into a folder, at build time:
// vellum-reference FOLDER VERSION DATE
#include <cstdio>
#include <filesystem>
#include <fstream>

#include "cli/manual/reference.h"
#include "core/utf8_path.h"

int main(int argc, char **argv)
{
    using namespace vellum::cli;
    if (argc != 4) {
        std::fprintf(stderr, "usage: vellum-reference FOLDER VERSION DATE\n");
        return 1;
    }
    const std::filesystem::path folder = argv[1];
    bool written = true;
    const auto write = [&](const std::string &name, const std::string &text) {
        std::ofstream file(folder / name, std::ios::binary);
        file << text;
        file.close();
        if (!file)
            std::fprintf(stderr, "%s cannot be written\n", vellum::utf8Text(folder / name).c_str());
        written = written && !file.fail();
    };
    const std::vector<ReferenceCommand> commands = readCommands();
    const ManEdition edition{argv[2], argv[3]};
    for (size_t i = 1; i < commands.size(); ++i)
        if (commands[i].name != "help")
            write("vellum-" + commands[i].name + ".1", manPageOf(commands, i, edition));
    write("vellum.1", manPage(commands, edition));
    write("vellum.bash", bashCompletion(commands));
    write("_vellum", zshCompletion(commands));
    write("vellum.fish", fishCompletion(commands));
    return written ? 0 : 1;
}
