// Runs of texels along both axes that cover a tile and its border: each within one block of the texture.
// A tile along one axis, in texels of its mip. What is read there comes in runs of 2^`shift` texels, then one of the border alone.
struct Axis {
    int first;    // texel
    int size;     // of the mip
};

int run_count(int shift) {
    return (TILE_SIDE >> shift) + 1;
}

bool is_border(int shift, int run) {
    return run == TILE_SIDE >> shift;
}

// First texel of a run; the border may be the one right beyond the last of the mip.
int run_texel(Axis axis, int shift, int run) {
    return is_border(shift, run) ? min(axis.first + TILE_SIDE, axis.size) : axis.first + (run << shift);
}

// End of the texels of a run that are kept, which begins at `texel`.
int run_end(Axis axis, int shift, int run, int texel) {
    return is_border(shift, run) ? texel + 1 : min(texel + (1 << shift), axis.size);
}

// Texels within a run along each axis.
struct Part {
    ivec2 texel;    // that it begins with
    ivec2 end;      // of those that are kept; not behind `texel` where there are none
    ivec2 read;     // the texel of the texture that is kept at `texel`: the left and top one of the part
};

Part part_at(Axis across, Axis down, int shift, ivec2 run) {
    Part part;
    part.texel = ivec2(run_texel(across, shift, run.x), run_texel(down, shift, run.y));
    part.end.x = run_end(across, shift, run.x, part.texel.x);
    part.end.y = run_end(down, shift, run.y, part.texel.y);
    part.read = ivec2(kept_texel(part.texel.x, across.size), kept_texel(part.texel.y, down.size));
    return part;
}

bool is_kept(Part part, ivec2 texel) {
    return all(lessThan(texel, part.end));
}

// `number` of rows of `across` by column and row. Both are small: a division of whole numbers takes long.
ivec2 in_rows(int number, int across) {
    int row = int((float(number) + 0.5) / float(across));
    return ivec2(number - row * across, row);
}
