// SPDX-License-Identifier: Apache-2.0
// Writes the printable characters of ASCII, drawn in some sizes of a TrueType font, as a C++ header. Runs when Vellum
// is built, so that the command needs no font. usage: make_font HEADER [NAME FILE.ttf PIXELS]...
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <fstream>
#include <iterator>
#include <string>
#include <vector>

#define STB_TRUETYPE_IMPLEMENTATION
#define STBTT_STATIC
#include <stb_truetype.h>

namespace
{

void writeFont(std::ofstream &out, const std::string &name, const std::string &path, float pixels)
{
    std::ifstream file(path, std::ios::binary);
    const std::vector<unsigned char> bytes{std::istreambuf_iterator<char>(file), {}};
    stbtt_fontinfo font;
    if (bytes.empty() || stbtt_InitFont(&font, bytes.data(), 0) == 0) {
        std::fprintf(stderr, "make_font: %s is no font\n", path.c_str());
        std::exit(1);
    }
    const float scale = stbtt_ScaleForMappingEmToPixels(&font, pixels);
    std::vector<unsigned> coverage;
    out << "inline constexpr Glyph k" << name << "Glyphs[] = {\n";
    for (int c = 32; c < 127; ++c) {
        int advance = 0;
        stbtt_GetCodepointHMetrics(&font, c, &advance, nullptr);
        int width = 0, height = 0, left = 0, top = 0;
        unsigned char *glyph = stbtt_GetCodepointBitmap(&font, scale, scale, c, &width, &height, &left, &top);
        out << "{" << coverage.size() << "," << left << "," << top << "," << width << "," << height << ","
            << std::lround(static_cast<float>(advance) * scale * 64) << "},\n";
        for (int i = 0; i < width * height; ++i)
            coverage.push_back(glyph[i]);
        stbtt_FreeBitmap(glyph, nullptr);
    }
    out << "};\ninline constexpr uint8_t k" << name << "Coverage[] = {";
    for (size_t i = 0; i < coverage.size(); ++i)
        out << (i % 24 == 0 ? "\n" : "") << coverage[i] << ",";
    out << "};\n";
}

} // namespace

int main(int argc, char **argv)
{
    if (argc < 2)
        return 2;
    std::ofstream out(argv[1]);
    out << "#pragma once\n#include <cstdint>\n#include \"cli/picture/font/glyph.h\"\nnamespace vellum::cli\n{\n";
    for (int i = 2; i + 2 < argc; i += 3)
        writeFont(out, argv[i], argv[i + 1], static_cast<float>(std::atof(argv[i + 2])));
    out << "} // namespace vellum::cli\n";
    return out.good() ? 0 : 1;
}
