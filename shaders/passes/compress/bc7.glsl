// Compresses 16 texels to BC7. Each mode approximates texels by points on a line: two quantised ends and an index for each texel.
// 1. The line starts along the principal axis of the texels (power iteration on their covariance), between the extreme projections.
// 2. Each texel takes the nearest point. Least squares then gives better ends for these indices.
// 3. Mode 6, one line through RGBA, comes first; a block with a small error ends there. Then two lines compete (mode 1 if opaque, else 7), in
//    the two of 16 partitions with the smallest squared distance from two principal axes; and mode 5, lines through RGB and through alpha.
// All sums of texels are whole numbers below 2^24, which floats hold exactly. So all drivers get the same block.
// ntc/c/ntc.c is the twin in C, with more tries. Results: docs/explanation/decode-paths.md#path-on-load-block-compression-on-the-gpu.

// Texels by channel, one row of the block per element: whole numbers from 0 to 255.
vec4 channels[16];    // row + 4 * channel
// 1 where a texel belongs to the second line.
vec4 seconds[4];

// How a mode stores a line.
struct LineKind {
    int total;       // bits of an end's channel, with its p bit
    int p_bits;      // 2: one for each end, 1: one for both, 0: none
    float last;      // largest index
    vec4 through;    // 1 for each channel that the line goes through
};

struct Lines {
    vec4 ends[4];     // of the first line, then of the second: stored integers, the p bit lowest
    vec4 indices[4];  // by row
    float error;      // squared error in steps of 1/255
};

// Texels of the second line in the 16 partitions that are tried, as bits, texel 0 lowest. The anchors are texels 0 and 15.
const uint PARTITIONS[16] = uint[](
    0xCCCCu, 0x8888u, 0xEEEEu, 0xECC8u, 0xC880u, 0xFEECu, 0xFEC8u, 0xEC80u,
    0xC800u, 0xFFECu, 0xFE80u, 0xE800u, 0xFFE8u, 0xFF00u, 0xFFF0u, 0xF000u
);

void split_by(uint division) {
    for (int row = 0; row < 4; ++row) {
        uvec4 bits = (uvec4(division) >> (uvec4(0u, 1u, 2u, 3u) + uint(4 * row))) & 1u;
        seconds[row] = vec4(bits);
    }
}

float sum_of(vec4 values) {
    return (values.x + values.y) + (values.z + values.w);
}

// Expands a stored end of `total` bits to 8 bits, as hardware does.
vec4 expanded_end(vec4 stored, int total) {
    float scale = float(1 << (8 - total));
    return total == 8 ? stored : stored * scale + floor(stored / float(1 << (2 * total - 8)));
}

vec4 stored_end(vec4 value, LineKind kind, float p) {
    float most = float((1 << kind.total) - 1);
    precise vec4 scaled = value * most / 255.0;
    if (kind.p_bits == 0) return clamp(floor(scaled + 0.5), 0.0, most);
    precise vec4 half_way = (scaled - p) * 0.5 + 0.5;
    return clamp(floor(half_way), 0.0, floor(most * 0.5)) * 2.0 + p;
}

float end_error(vec4 value, vec4 stored, LineKind kind) {
    precise vec4 away = (expanded_end(stored, kind.total) - value) * kind.through;
    precise vec4 squared = away * away;
    return sum_of(squared);
}

// Quantises both ends of a line with the nearer p bits.
void store_ends(vec4 low, vec4 high, LineKind kind, out vec4 stored_low, out vec4 stored_high) {
    vec4 low_0 = stored_end(low, kind, 0.0);
    vec4 low_1 = stored_end(low, kind, 1.0);
    vec4 high_0 = stored_end(high, kind, 0.0);
    vec4 high_1 = stored_end(high, kind, 1.0);
    precise float low_gain = end_error(low, low_0, kind) - end_error(low, low_1, kind);
    precise float high_gain = end_error(high, high_0, kind) - end_error(high, high_1, kind);
    precise float both = low_gain + high_gain;
    bool low_p = kind.p_bits > 0 && (kind.p_bits == 1 ? both : low_gain) > 0.0;
    bool high_p = kind.p_bits > 0 && (kind.p_bits == 1 ? both : high_gain) > 0.0;
    stored_low = low_p ? low_1 : low_0;
    stored_high = high_p ? high_1 : high_0;
}

// Principal axis by power iteration. The arguments are the covariance matrix, times any factor.
vec4 axis_of(vec4 squares, vec4 mixed_red, vec2 mixed_green, float mixed_blue) {
    vec4 rows[4];
    rows[0] = vec4(squares.x, mixed_red.xyz);
    rows[1] = vec4(mixed_red.x, squares.y, mixed_green);
    rows[2] = vec4(mixed_red.y, mixed_green.x, squares.z, mixed_blue);
    rows[3] = vec4(mixed_red.z, mixed_green.y, mixed_blue, squares.w);
    float widest = max(max(squares.x, squares.y), max(squares.z, squares.w));
    vec4 axis = squares.x == widest ? rows[0] : (squares.y == widest ? rows[1] : (squares.z == widest ? rows[2] : rows[3]));
    for (int round = 0; round < AXIS_ROUNDS; ++round) {
        float largest = max(max(abs(axis.x), abs(axis.y)), max(abs(axis.z), abs(axis.w)));
        axis = largest > 0.0 ? axis / largest : axis;
        precise vec4 next = rows[0] * axis.x + rows[1] * axis.y + rows[2] * axis.z + rows[3] * axis.w;
        axis = next;
    }
    float largest = max(max(abs(axis.x), abs(axis.y)), max(abs(axis.z), abs(axis.w)));
    return largest > 0.0 ? axis / largest : vec4(0.0);
}

// Sums over the texels of one line: of channels, and of products of channels.
struct Sums {
    float count;
    vec4 values;
    vec4 squares;
    vec3 mixed_red;
    vec2 mixed_green;
    float mixed_blue;
};

Sums sums_over(bool is_second, vec4 through) {
    Sums sums = Sums(0.0, vec4(0.0), vec4(0.0), vec3(0.0), vec2(0.0), 0.0);
    for (int row = 0; row < 4; ++row) {
        vec4 share = is_second ? seconds[row] : 1.0 - seconds[row];
        vec4 r = channels[row] * through.r, g = channels[row + 4] * through.g;
        vec4 b = channels[row + 8] * through.b, a = channels[row + 12] * through.a;
        vec4 line_r = r * share, line_g = g * share, line_b = b * share, line_a = a * share;
        sums.count += sum_of(share);
        sums.values += vec4(sum_of(line_r), sum_of(line_g), sum_of(line_b), sum_of(line_a));
        sums.squares += vec4(dot(line_r, r), dot(line_g, g), dot(line_b, b), dot(line_a, a));
        sums.mixed_red += vec3(dot(line_r, g), dot(line_r, b), dot(line_r, a));
        sums.mixed_green += vec2(dot(line_g, b), dot(line_g, a));
        sums.mixed_blue += dot(line_b, a);
    }
    return sums;
}

// Returns the sums of products about the mean, times `count`: whole numbers.
Sums centred(Sums sums) {
    vec4 values = sums.values;
    sums.squares = sums.squares * sums.count - values * values;
    sums.mixed_red = sums.mixed_red * sums.count - values.r * values.gba;
    sums.mixed_green = sums.mixed_green * sums.count - values.g * values.ba;
    sums.mixed_blue = sums.mixed_blue * sums.count - values.b * values.a;
    return sums;
}

// Ends of the line along the principal axis of a subset's texels.
void line_through(bool is_second, vec4 through, out vec4 low, out vec4 high) {
    Sums sums = sums_over(is_second, through);
    precise vec4 mean = sums.values / max(sums.count, 1.0);
    sums = centred(sums);
    vec4 axis = axis_of(sums.squares, vec4(sums.mixed_red, 0.0), sums.mixed_green, sums.mixed_blue);
    precise vec4 squared = axis * axis;
    precise float length_squared = sum_of(squared);
    float least = 1e30, most = -1e30;
    for (int row = 0; row < 4; ++row) {
        precise vec4 along = (channels[row] - mean.r) * axis.r + (channels[row + 4] - mean.g) * axis.g
            + (channels[row + 8] - mean.b) * axis.b + (channels[row + 12] - mean.a) * axis.a;
        vec4 other = is_second ? 1.0 - seconds[row] : seconds[row];
        vec4 below = along + other * 1e30, above = along - other * 1e30;
        least = min(least, min(min(below.x, below.y), min(below.z, below.w)));
        most = max(most, max(max(above.x, above.y), max(above.z, above.w)));
    }
    precise vec4 step = length_squared > 0.0 ? axis / length_squared : vec4(0.0);
    precise vec4 from = mean + step * (length_squared > 0.0 ? least : 0.0);
    precise vec4 to = mean + step * (length_squared > 0.0 ? most : 0.0);
    // A channel that the line does not go through is alpha of opaque texels.
    low = mix(vec4(255.0), from, through);
    high = mix(vec4(255.0), to, through);
}

// Sets the indices of `lines` to the nearest points of their ends, and the error.
void find_indices(LineKind kind, inout Lines lines) {
    vec4 low = expanded_end(lines.ends[0], kind.total);
    vec4 way = (expanded_end(lines.ends[1], kind.total) - low) * kind.through;
    vec4 other_low = expanded_end(lines.ends[2], kind.total);
    vec4 other_way = (expanded_end(lines.ends[3], kind.total) - other_low) * kind.through;
    vec4 low_step = other_low - low, way_step = other_way - way;
    float scale = dot(way, way);
    scale = scale > 0.0 ? kind.last / scale : 0.0;
    float other_scale = dot(other_way, other_way);
    other_scale = other_scale > 0.0 ? kind.last / other_scale : 0.0;
    float per_index = 64.0 / kind.last;
    float error = 0.0;
    for (int row = 0; row < 4; ++row) {
        vec4 second = seconds[row];
        vec4 way_r = way.r + second * way_step.r, way_g = way.g + second * way_step.g;
        vec4 way_b = way.b + second * way_step.b, way_a = way.a + second * way_step.a;
        vec4 r = channels[row] - (low.r + second * low_step.r), g = channels[row + 4] - (low.g + second * low_step.g);
        vec4 b = channels[row + 8] - (low.b + second * low_step.b), a = channels[row + 12] - (low.a + second * low_step.a);
        vec4 along = r * way_r + g * way_g + b * way_b + a * way_a;
        precise vec4 place = along * mix(vec4(scale), vec4(other_scale), second) + 0.5;
        vec4 index = clamp(floor(place), 0.0, kind.last);
        lines.indices[row] = index;
        // BC7's weights are whole numbers in 1/64. All values are whole numbers too, so only `floor` rounds.
        precise vec4 weight = floor(index * per_index + 0.5) / 64.0;
        r -= floor(way_r * weight + 0.5);
        g -= floor(way_g * weight + 0.5);
        b -= floor(way_b * weight + 0.5);
        a -= floor(way_a * weight + 0.5);
        vec4 squared = r * r * kind.through.r + g * g * kind.through.g + b * b * kind.through.b + a * a * kind.through.a;
        error += sum_of(squared);
    }
    lines.error = error;
}

// Sums for least squares: the ends of a line with the least error for its indices. Weights are in 1/64.
struct Fit {
    float both_low;
    float mixed;
    float both_high;
    vec4 lows;
    vec4 highs;
};

Fit fit_of(bool is_second, LineKind kind, Lines lines) {
    Fit fit = Fit(0.0, 0.0, 0.0, vec4(0.0), vec4(0.0));
    float per_index = 64.0 / kind.last;
    for (int row = 0; row < 4; ++row) {
        vec4 share = is_second ? seconds[row] : 1.0 - seconds[row];
        precise vec4 weight = floor(lines.indices[row] * per_index + 0.5);
        vec4 rest = (64.0 - weight) * share;
        fit.both_low += dot(rest, rest);
        fit.mixed += dot(rest, weight);
        weight *= share;
        fit.both_high += dot(weight, weight);
        fit.lows += vec4(dot(rest, channels[row]), dot(rest, channels[row + 4]), dot(rest, channels[row + 8]), dot(rest, channels[row + 12]));
        fit.highs += vec4(
            dot(weight, channels[row]), dot(weight, channels[row + 4]), dot(weight, channels[row + 8]), dot(weight, channels[row + 12])
        );
    }
    return fit;
}

void refit(Fit fit, LineKind kind, inout vec4 low, inout vec4 high) {
    precise float determinant = fit.both_low * fit.both_high - fit.mixed * fit.mixed;
    if (determinant < 1.0) return;
    precise vec4 first = (fit.both_high * fit.lows - fit.mixed * fit.highs) / determinant * 64.0;
    precise vec4 last = (fit.both_low * fit.highs - fit.mixed * fit.lows) / determinant * 64.0;
    low = mix(vec4(255.0), clamp(first, 0.0, 255.0), kind.through);
    high = mix(vec4(255.0), clamp(last, 0.0, 255.0), kind.through);
}

// The high end with the least error for a stored low end.
vec4 high_for(Fit fit, vec4 stored_low, LineKind kind, vec4 high) {
    if (fit.both_high < 1.0) return high;
    precise vec4 end = (fit.highs * 64.0 - fit.mixed * expanded_end(stored_low, kind.total)) / fit.both_high;
    return mix(vec4(255.0), clamp(end, 0.0, 255.0), kind.through);
}

vec4 low_for(Fit fit, vec4 stored_high, LineKind kind, vec4 low) {
    if (fit.both_low < 1.0) return low;
    precise vec4 end = (fit.lows * 64.0 - fit.mixed * expanded_end(stored_high, kind.total)) / fit.both_low;
    return mix(vec4(255.0), clamp(end, 0.0, 255.0), kind.through);
}

// Fits the lines of both subsets of `seconds`.
Lines fit_lines(LineKind kind, bool are_two, int rounds) {
    Lines best, made;
    best.error = 1e30;
    Fit fit;
    vec4 low, high, other_low = vec4(0.0), other_high = vec4(0.0);
    line_through(false, kind.through, low, high);
    if (are_two) line_through(true, kind.through, other_low, other_high);
    for (int round = 0; round <= rounds; ++round) {
        if (round > 0) {
            fit = fit_of(false, kind, best);
            refit(fit, kind, low, high);
            if (are_two) refit(fit_of(true, kind, best), kind, other_low, other_high);
        }
        // Mode 6 tries all pairs of p bits; other modes take the nearest.
        int pairs = kind.p_bits == 2 && !are_two ? (round > 0 ? MODE_6_PAIRS : 4) : 1;
        for (int pair = 0; pair < pairs; ++pair) {
            if (pairs > 1) {
                vec4 first = low, last = high;
                if (round > 0) {
                    if (pair < 4) last = high_for(fit, stored_end(first, kind, float(pair & 1)), kind, high);
                    else first = low_for(fit, stored_end(last, kind, float((pair >> 1) & 1)), kind, low);
                }
                made.ends[0] = stored_end(first, kind, float(pair & 1));
                made.ends[1] = stored_end(last, kind, float((pair >> 1) & 1));
            } else {
                store_ends(low, high, kind, made.ends[0], made.ends[1]);
                store_ends(other_low, other_high, kind, made.ends[2], made.ends[3]);
            }
            find_indices(kind, made);
            if (made.error < best.error) best = made;
        }
    }
    return best;
}

// Estimate of the sum of squared distances from the principal axis: the covariance's trace without its largest eigenvalue. The Frobenius norm
// stands in for that eigenvalue, which it equals if the others are 0.
float away_from_line(Sums sums) {
    if (sums.count < 1.0) return 0.0;
    sums = centred(sums);
    vec4 squares = sums.squares / 1024.0;
    vec3 mixed_red = sums.mixed_red / 1024.0;
    vec2 mixed_green = sums.mixed_green / 1024.0;
    float mixed_blue = sums.mixed_blue / 1024.0;
    precise float norm = dot(squares, squares)
        + 2.0 * (dot(mixed_red, mixed_red) + dot(mixed_green, mixed_green) + mixed_blue * mixed_blue);
    precise float away = (sum_of(squares) - sqrt(norm)) / sums.count;
    return max(away, 0.0);
}

Sums without(Sums all, Sums part) {
    return Sums(
        all.count - part.count, all.values - part.values, all.squares - part.squares, all.mixed_red - part.mixed_red,
        all.mixed_green - part.mixed_green, all.mixed_blue - part.mixed_blue
    );
}

// The two partitions with the smallest squared distances from two lines, the best first.
ivec2 best_partitions(vec4 through) {
    ivec2 best = ivec2(0);
    vec2 least = vec2(1e30);
    split_by(0u);
    Sums all = sums_over(false, through);
    for (int number = 0; number < 16; ++number) {
        split_by(PARTITIONS[number]);
        Sums second = sums_over(true, through);
        precise float away = away_from_line(second) + away_from_line(without(all, second));
        if (away < least.x) {
            best = ivec2(number, best.x);
            least = vec2(away, least.x);
        } else if (away < least.y) {
            best.y = number;
            least.y = away;
        }
    }
    return best;
}

// Swaps the ends of a line if the highest bit of its anchor's index is 1: that bit is not stored.
void turn(bool is_second, float last, inout Lines lines) {
    float anchor = is_second ? lines.indices[3].w : lines.indices[0].x;
    if (anchor <= last * 0.5) return;
    int first = is_second ? 2 : 0;
    vec4 low = is_second ? lines.ends[2] : lines.ends[0];
    vec4 high = is_second ? lines.ends[3] : lines.ends[1];
    if (is_second) {
        lines.ends[2] = high;
        lines.ends[3] = low;
    } else {
        lines.ends[0] = high;
        lines.ends[1] = low;
    }
    for (int row = 0; row < 4; ++row) {
        vec4 share = is_second ? seconds[row] : 1.0 - seconds[row];
        lines.indices[row] = mix(lines.indices[row], last - lines.indices[row], share);
    }
}

uvec4 written;
int written_bits;

// `value` has `count` bits, at most 8.
void put_bits(uint value, int count) {
    int shift = written_bits & 31;
    uint low = value << uint(shift);
    uint high = shift + count > 32 ? value >> uint(32 - shift) : 0u;
    int word = written_bits >> 5;
    written |= uvec4(word == 0 ? low : 0u, word == 1 ? low : (word == 0 ? high : 0u), word == 2 ? low : (word == 1 ? high : 0u), word == 3 ? low : (word == 2 ? high : 0u));
    written_bits += count;
}

void put_indices(vec4 indices[4], int bits, bool has_second_anchor) {
    for (int row = 0; row < 4; ++row) {
        uvec4 row_indices = uvec4(indices[row]);
        put_bits(row_indices.x, bits - (row == 0 ? 1 : 0));
        put_bits(row_indices.y, bits);
        put_bits(row_indices.z, bits);
        put_bits(row_indices.w, bits - (has_second_anchor && row == 3 ? 1 : 0));
    }
}

// Writes one channel of both ends. With `has_p`, the lowest bit is a p bit, which `put_p` writes.
void put_ends(float first, float last, int bits, bool has_p) {
    uint shift = has_p ? 1u : 0u;
    put_bits(uint(first) >> shift, bits);
    put_bits(uint(last) >> shift, bits);
}

void put_p(vec4 stored) {
    put_bits(uint(stored.r) & 1u, 1);
}

uvec4 mode_6_block(Lines lines) {
    split_by(0u);
    turn(false, 15.0, lines);
    written = uvec4(0u);
    written_bits = 0;
    put_bits(64u, 7);
    put_ends(lines.ends[0].r, lines.ends[1].r, 7, true);
    put_ends(lines.ends[0].g, lines.ends[1].g, 7, true);
    put_ends(lines.ends[0].b, lines.ends[1].b, 7, true);
    put_ends(lines.ends[0].a, lines.ends[1].a, 7, true);
    put_p(lines.ends[0]);
    put_p(lines.ends[1]);
    put_indices(lines.indices, 4, false);
    return written;
}

// Modes 1 (opaque) and 7.
uvec4 two_lines_block(Lines lines, int division, bool is_opaque) {
    float last = is_opaque ? 7.0 : 3.0;
    int bits = is_opaque ? 6 : 5;
    split_by(PARTITIONS[division]);
    turn(false, last, lines);
    turn(true, last, lines);
    written = uvec4(0u);
    written_bits = 0;
    put_bits(is_opaque ? 2u : 128u, is_opaque ? 2 : 8);
    put_bits(uint(division), 6);
    for (int channel = 0; channel < (is_opaque ? 3 : 4); ++channel) {
        put_ends(lines.ends[0][channel], lines.ends[1][channel], bits, true);
        put_ends(lines.ends[2][channel], lines.ends[3][channel], bits, true);
    }
    put_p(lines.ends[0]);
    if (!is_opaque) put_p(lines.ends[1]);
    put_p(lines.ends[2]);
    if (!is_opaque) put_p(lines.ends[3]);
    put_indices(lines.indices, is_opaque ? 3 : 2, true);
    return written;
}

uvec4 mode_5_block(Lines lines, Lines alpha) {
    split_by(0u);
    turn(false, 3.0, lines);
    turn(false, 3.0, alpha);
    written = uvec4(0u);
    written_bits = 0;
    put_bits(32u, 6);
    put_bits(0u, 2);
    put_ends(lines.ends[0].r, lines.ends[1].r, 7, false);
    put_ends(lines.ends[0].g, lines.ends[1].g, 7, false);
    put_ends(lines.ends[0].b, lines.ends[1].b, 7, false);
    put_ends(alpha.ends[0].a, alpha.ends[1].a, 8, false);
    put_indices(lines.indices, 2, false);
    put_indices(alpha.indices, 2, false);
    return written;
}

const vec4 RGB = vec4(1.0, 1.0, 1.0, 0.0);

// Squared error of a block, in steps of 1/255, up to which no other mode is tried.
const float GOOD_ENOUGH = 8.0;
const int MODE_6 = 0, TWO_LINES = 1, OTHER_TWO_LINES = 2, MODE_5_RGB = 3, MODE_5_ALPHA = 4;

// Returns the block of `channels`, and its squared error in steps of 1/255.
uvec4 compress_bc7(out float error) {
    bool is_opaque = true;
    for (int row = 0; row < 4; ++row) is_opaque = is_opaque && all(equal(channels[row + 12], vec4(255.0)));
    LineKind kinds[5] = LineKind[](
        LineKind(8, 2, 15.0, is_opaque ? vec4(1.0,1.0,1.0,0.0) : vec4(1.0)),
        is_opaque ? LineKind(7, 1, 7.0, RGB) : LineKind(6, 2, 3.0, vec4(1.0)),
        is_opaque ? LineKind(7, 1, 7.0, RGB) : LineKind(6, 2, 3.0, vec4(1.0)),
        LineKind(7, 0, 3.0, RGB),
        LineKind(8, 0, 3.0, vec4(0.0, 0.0, 0.0, 1.0))
    );
    Lines best, other;
    best.error = 1e30;
    int taken = MODE_6;
    ivec2 partitions = ivec2(0);
    int division = 0;
    // A loop, so the body is compiled once. It ends early if the remaining modes cannot help.
    int tries = 5;
    for (int number = 0; number < tries; ++number) {
        LineKind kind = kinds[number];
        bool are_two = number == TWO_LINES || number == OTHER_TWO_LINES;
        if (number == TWO_LINES) partitions = best_partitions(kind.through);
        int candidate = number == OTHER_TWO_LINES ? partitions.y : partitions.x;
        split_by(are_two ? PARTITIONS[candidate] : 0u);
        Lines made = fit_lines(kind, are_two, number == MODE_6 ? MODE_6_ROUNDS : ROUNDS);
        if (number < MODE_5_RGB) {
            if (made.error < best.error) {
                best = made;
                taken = number;
                division = candidate;
            }
        } else if (number == MODE_5_RGB) {
            other = made;
        } else if (other.error + made.error < best.error) {
            best.error = other.error + made.error;
            taken = MODE_5_ALPHA;
            best.ends[0].a = made.ends[0].a;
            best = Lines(vec4[](other.ends[0], other.ends[1], made.ends[0], made.ends[1]), other.indices, best.error);
            other.indices = made.indices;
        }
        if (best.error <= GOOD_ENOUGH) tries = 0;
        // The second partition is tried only if the first one improved the block.
        else if (is_opaque) tries = number == TWO_LINES && taken == MODE_6 ? 0 : 3;
    }
    error = best.error;
    if (taken == MODE_6) return mode_6_block(best);
    if (taken == MODE_5_ALPHA) {
        Lines alpha = Lines(vec4[](best.ends[2], best.ends[3], vec4(0.0), vec4(0.0)), other.indices, 0.0);
        return mode_5_block(best, alpha);
    }
    return two_lines_block(best, division, is_opaque);
}
