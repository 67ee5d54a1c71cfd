// Decodes texels of ntc_pack.bin on a CPU, as a reference for decoders in engines.
//
//   c++ -std=c++17 -O2 -o ntc_reference ntc_reference.cpp
//   echo "0 base 0.5 0.5 0 0 0" | ./ntc_reference ntc_pack.bin
//
// Each line of the input names a texel: texture number, plane, u, v, lod, and the wrap modes along u and v (0 repeat, 1 mirror,
// 2 clamp). Each line of the output has its four components. Exit status: 0, or 2 with one line on stderr.
#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <fstream>
#include <iostream>
#include <sstream>
#include <string>
#include <vector>

#include "ntc_decode.hpp"
#include "ntc_layout.h"

namespace {

[[noreturn]] void refuse(const std::string& problem) {
    std::fprintf(stderr, "error: %s\n", problem.c_str());
    std::exit(2);
}

// The words of the file, whatever the byte order of this machine.
std::vector<ntc::uint> read_words(const char* path) {
    std::ifstream file(path, std::ios::binary);
    std::ostringstream all;
    // Some systems open a folder like a file; reading it fails.
    if (!file || !(all << file.rdbuf())) refuse(std::string(path) + ": cannot be read, or is empty");
    const std::string bytes = all.str();
    if (bytes.size() % 4 != 0) refuse(std::string(path) + ": does not end with a whole word");
    std::vector<ntc::uint> words(bytes.size() / 4);
    for (std::size_t i = 0; i < words.size(); ++i) {
        unsigned char part[4];
        std::memcpy(part, bytes.data() + 4 * i, 4);
        words[i] = part[0] | ntc::uint(part[1]) << 8 | ntc::uint(part[2]) << 16 | ntc::uint(part[3]) << 24;
    }
    return words;
}

// A section of `count` records of `record_words` words lies between the header and the end.
void check_section(const char* path, const char* name, std::uint64_t first, std::uint64_t count, std::uint64_t record_words,
                   std::uint64_t total) {
    if (first < NTC_HEADER_WORDS || first > total || count * record_words > total - first)
        refuse(std::string(path) + ": section " + name + " lies outside the file");
}

void check(const char* path, const std::vector<ntc::uint>& words) {
    if (words.size() < NTC_HEADER_WORDS || words[NTC_WORD_MAGIC] != NTC_MAGIC)
        refuse(std::string(path) + ": is not data of ntc-viewer export --shader");
    if (words[NTC_WORD_VERSION] != NTC_VERSION) refuse(std::string(path) + ": has another version of the layout");
    if (words[NTC_WORD_CODEC] != NTC_CODEC) refuse(std::string(path) + ": was made for a decoder of other settings");
    if (words[NTC_WORD_TOTAL_WORDS] != words.size()) refuse(std::string(path) + ": its length differs from that in its header");
    const std::uint64_t total = words.size(), levels = words[NTC_WORD_LEVEL_COUNT];
    const std::uint64_t textures = words[NTC_WORD_TEXTURE_COUNT];
    check_section(path, "textures", words[NTC_WORD_TEXTURES], textures, sizeof(ntc_texture_record) / 4, total);
    check_section(path, "levels", words[NTC_WORD_LEVELS], levels, sizeof(ntc_level_record) / 4, total);
    check_section(path, "decoders", words[NTC_WORD_DECODERS], 0, 4, total);
    check_section(path, "latents", words[NTC_WORD_LATENTS], 0, NTC_CELL_WORDS, total);
    if (words[NTC_WORD_LATENTS] < words[NTC_WORD_DECODERS] || total > 0x7FFFFFFF)
        refuse(std::string(path) + ": sections lie in another order, or are too large");
    for (std::uint64_t i = 0; i < textures; ++i) {
        ntc_texture_record record;
        std::memcpy(&record, &words[words[NTC_WORD_TEXTURES] + i * (sizeof record / 4)], sizeof record);
        const std::int64_t first = record.first_level, count = record.levels;
        if (first < 0 || count < 1 || first + count > std::int64_t(levels) || record.finest_level < 0 ||
            record.finest_level >= count)
            refuse(std::string(path) + ": texture " + std::to_string(i) + " names mips that do not exist");
        const std::uint64_t blocks = (words[NTC_WORD_LATENTS] - words[NTC_WORD_DECODERS]) / 4;
        if (record.decoder < 0 || (record.decoder + 1ull) * NTC_DECODER_BLOCKS > blocks ||
            record.adapter < 0 || record.adapter + std::uint64_t(NTC_ADAPTER_BLOCKS) > blocks)
            refuse(std::string(path) + ": texture " + std::to_string(i) + " names a decoder that does not exist");
    }
    for (std::uint64_t i = 0; i < levels; ++i) {
        ntc_level_record record;
        std::memcpy(&record, &words[words[NTC_WORD_LEVELS] + i * (sizeof record / 4)], sizeof record);
        const std::int32_t largest = 1 << 16;
        if (record.width < 1 || record.height < 1 || record.texel_width < 1 || record.texel_height < 1 ||
            record.width > largest || record.height > largest || record.texel_width > largest ||
            record.texel_height > largest || record.first_cell < 0 || record.first_cell > std::int32_t(total))
            refuse(std::string(path) + ": mip " + std::to_string(i) + " has an impossible size or place");
    }
}

bool decode(const ntc::decoder& decoder, const std::string& plane, int texture, ntc::vec2 uv, float lod, ntc::ivec2 wrap,
            ntc::vec4& value) {
    // PLANES
    return false;
}

}  // namespace

int main(int argc, char** argv) {
    if (argc != 2) refuse("usage: ntc_reference ntc_pack.bin < texels");
    const std::vector<ntc::uint> words = read_words(argv[1]);
    check(argv[1], words);
    const ntc::decoder decoder{words.data(), ntc::uint(words.size())};
    std::string line;
    for (long number = 1; std::getline(std::cin, line); ++number) {
        std::istringstream parts(line);
        std::string plane;
        int texture = 0;
        float u = 0.0f, v = 0.0f, lod = 0.0f;
        int wrap_u = 0, wrap_v = 0;
        if (!(parts >> texture >> plane >> u >> v >> lod >> wrap_u >> wrap_v))
            refuse("line " + std::to_string(number) + ": expected texture, plane, u, v, lod, wrap_u, wrap_v");
        if (texture < 0 || ntc::uint(texture) >= words[NTC_WORD_TEXTURE_COUNT])
            refuse("line " + std::to_string(number) + ": there is no texture " + std::to_string(texture));
        ntc::vec4 value;
        if (!decode(decoder, plane, texture, ntc::vec2(u, v), lod, ntc::ivec2(wrap_u, wrap_v), value))
            refuse("line " + std::to_string(number) + ": the codec has no plane " + plane);
        std::printf("%.9g %.9g %.9g %.9g\n", value.x, value.y, value.z, value.w);
    }
    return 0;
}
