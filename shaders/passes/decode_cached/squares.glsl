// Squares of 2x2 texels that cover a tile and its border: each within one block of the texture.
// A tile along one axis, in texels of its mip. What is read there comes in runs: of blocks or of squares of texels inside, then one for
// each texel of the border, then one for the texel right beyond the texture's edge, where the edge cuts a run.
struct Axis {
    int first;       // texel, the border not counted
    int size;        // of the mip
    ivec2 beside;    // texels that are read before the first one of the mip, and beyond the last one
};

Axis axis_of(int first, int size, int wrap) {
    return Axis(first, size, ivec2(from_first(-1, size, wrap), to_last(size, size, wrap)));
}

// Whether the texel right beyond the texture's edge lies within the tile, but not at its begin.
bool holds_edge(Axis axis) {
    return axis.size > axis.first && axis.size < axis.first + TILE_SIDE;
}

// Texel `number` outside: of the border on both sides, then the one right beyond the texture's edge.
int border_texel(Axis axis, int number) {
    return number == 0 ? axis.first - 1 : (number == 1 ? axis.first + TILE_SIDE : axis.size);
}

int run_count(Axis axis, int shift) {
    bool cuts_run = holds_edge(axis) && (axis.size & ((1 << shift) - 1)) != 0;
    return (TILE_SIDE >> shift) + 2 + int(cuts_run);
}

// First texel of a run of 2^`shift` texels.
int run_texel(Axis axis, int shift, int run) {
    int outside = run - (TILE_SIDE >> shift);
    return outside < 0 ? axis.first + (run << shift) : border_texel(axis, outside);
}

// The texel of the texture that is read at `texel`, at most one beyond its edges.
int texel_read(Axis axis, int texel) {
    return texel < 0 ? axis.beside.x : (texel == axis.size ? axis.beside.y : texel);
}

// `number` of rows of `across` by column and row. Both are small: a division of whole numbers takes long.
ivec2 in_rows(int number, int across) {
    int row = int((float(number) + 0.5) / float(across));
    return ivec2(number - row * across, row);
}

// Run along both axes of square `number`: first those inside, in groups of four by four, which lie in few blocks, then columns, then rows.
ivec2 run_at(Axis across, Axis down, int shift, int number) {
    int runs = TILE_SIDE >> shift;
    int outside = number - runs * runs;
    if (outside < 0) {
        ivec2 group = ivec2((number >> 4) & (runs / 4 - 1), (number >> 2) / runs);
        return 4 * group + ivec2(number & 3, (number >> 2) & 3);
    }
    int more = run_count(across, shift) - runs;
    int beside = more * run_count(down, shift);
    ivec2 run = in_rows(outside < beside ? outside : outside - beside, outside < beside ? more : runs);
    return run + (outside < beside ? ivec2(runs, 0) : ivec2(0, runs));
}

// Squares of one texel where the mip of a code has no more.
int square_shift(int shift) {
    return min(shift, 1);
}

// Whether a run of texels that begins inside goes on with a second one.
bool has_second(Axis axis, int shift, int run, int texel) {
    return shift > 0 && run < TILE_SIDE >> shift && texel + 1 < axis.size;
}

// A square of 2^`shift` texels and what is stored of it.
struct Square {
    bool is_read;
    ivec2 run;
    ivec2 texel;     // that it begins with; along a border the only one
    ivec2 first;     // of its texels in the texture, the one on the left and top
    ivec2 within;    // of `texel` in the square
    bvec2 more;      // along each axis: whether the texel after `texel` belongs to it, too
};

Square square_at(Axis across, Axis down, int shift, int number) {
    Square square;
    square.run = run_at(across, down, shift, number);
    square.texel = ivec2(run_texel(across, shift, square.run.x), run_texel(down, shift, square.run.y));
    square.is_read = square.texel.x <= across.size && square.texel.y <= down.size;
    ivec2 read = ivec2(texel_read(across, square.texel.x), texel_read(down, square.texel.y));
    square.within = read & shift;
    square.first = read - square.within;
    square.more.x = has_second(across, shift, square.run.x, square.texel.x);
    square.more.y = has_second(down, shift, square.run.y, square.texel.y);
    return square;
}

// Whether texel `number` of a square is stored: 0 the first, then those on its right, below, and on its right below. Then `texel` is its
// place.
bool is_stored(Square square, int number, out ivec2 texel) {
    ivec2 place = ivec2(number & 1, number >> 1);
    texel = square.texel - square.within + place;
    return (square.more.x || place.x == square.within.x) && (square.more.y || place.y == square.within.y);
}
