// Division of a tile and its border into parts that lie within one block of the texture. Along each axis, a tile has runs of 2^`shift` texels,
// then a run of one texel, the border.

// A tile along one axis, in texels of its mip.
struct Axis {
    int first;    // texel
    int size;     // size of the mip
};

int run_count(int shift) {
    return (TILE_SIDE >> shift) + 1;
}

bool is_border(int shift, int run) {
    return run == TILE_SIDE >> shift;
}

// First texel of a run. The border may be the texel beyond the last one of the mip.
int run_texel(Axis axis, int shift, int run) {
    return is_border(shift, run) ? min(axis.first + TILE_SIDE, axis.size) : axis.first + (run << shift);
}

// End of the stored texels of a run that begins at `texel`.
int run_end(Axis axis, int shift, int run, int texel) {
    return is_border(shift, run) ? texel + 1 : min(texel + (1 << shift), axis.size);
}

// Texels of one run along each axis.
struct Part {
    ivec2 texel;    // first texel
    ivec2 end;      // end of the stored texels; at most `texel` if there are none
    ivec2 read;     // texel of the texture that is stored at `texel`
};

Part part_at(Axis across, Axis down, int shift, ivec2 run) {
    Part part;
    part.texel = ivec2(run_texel(across, shift, run.x), run_texel(down, shift, run.y));
    part.end.x = run_end(across, shift, run.x, part.texel.x);
    part.end.y = run_end(down, shift, run.y, part.texel.y);
    part.read = ivec2(texel_read_at(part.texel.x, across.size), texel_read_at(part.texel.y, down.size));
    return part;
}

bool is_stored(Part part, ivec2 texel) {
    return all(lessThan(texel, part.end));
}

// Column and row of element `number` in rows of `across`. Both are small, so a float division is exact enough; that of integers is slow.
ivec2 in_rows(int number, int across) {
    int row = int((float(number) + 0.5) / float(across));
    return ivec2(number - row * across, row);
}
