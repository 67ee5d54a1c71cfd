// Compresses 16 values to BC4: two ends, and for each value the index of an entry of the palette between them.
// With first > second the palette has eight values, else six values, 0 and 255. Tries: the smallest and largest value as ends; the ends with
// the least squared error for the indices of that try, and their eight neighbours, because the palette is rounded; then the palette of six.
// ntc/c/ntc.c is the twin in C. Results: docs/explanation/decode-paths.md#path-on-load-block-compression-on-the-gpu.

// Sets the indices of `values` (by row, whole numbers from 0 to 255). Returns the squared error times 25 * 49, which makes it a whole number.
float bc4_error(vec4 values[4], float first, float second, out vec4 indices[4]) {
    bool six = first <= second;
    float last = six ? 5.0 : 7.0;
    float way = second - first;
    float scale = way != 0.0 ? last / way : 0.0;
    float error = 0.0;
    for (int row = 0; row < 4; ++row) {
        precise vec4 place = (values[row] - first) * scale + 0.5;
        vec4 index = clamp(floor(place), 0.0, last);
        vec4 away = (values[row] - first) * last - index * way;
        vec4 squared = away * away;
        if (six) {
            // The values 0 and 255.
            vec4 dark = values[row] * last, bright = (255.0 - values[row]) * last;
            index = mix(index, vec4(6.0), lessThan(dark * dark, squared));
            squared = min(squared, dark * dark);
            index = mix(index, vec4(7.0), lessThan(bright * bright, squared));
            squared = min(squared, bright * bright);
        }
        indices[row] = index;
        error += (squared.x + squared.y) + (squared.z + squared.w);
    }
    return error * (six ? 49.0 : 25.0);
}

// Converts a position along the palette to a stored index.
uint bc4_code(float place, bool six) {
    if (six && place >= 6.0) return uint(place);
    float last = six ? 5.0 : 7.0;
    return place == 0.0 ? 0u : (place == last ? 1u : uint(place) + 1u);
}

uvec2 compress_bc4(vec4 values[4], out float error) {
    float low = 255.0, high = 0.0, inner_low = 255.0, inner_high = 0.0;
    for (int row = 0; row < 4; ++row) {
        vec4 row_values = values[row];
        low = min(low, min(min(row_values.x, row_values.y), min(row_values.z, row_values.w)));
        high = max(high, max(max(row_values.x, row_values.y), max(row_values.z, row_values.w)));
        vec4 above = mix(row_values, vec4(255.0), equal(row_values, vec4(0.0))), below = mix(row_values, vec4(0.0), equal(row_values, vec4(255.0)));
        inner_low = min(inner_low, min(min(above.x, above.y), min(above.z, above.w)));
        inner_high = max(inner_high, max(max(below.x, below.y), max(below.z, below.w)));
    }
    float best = 1e30;
    vec2 ends = vec2(high, low);
    vec4 indices[4], best_indices[4];
    for (int row = 0; row < 4; ++row) best_indices[row] = vec4(0.0);
    // A palette of eight neighbouring numbers is exact.
    if (high - low < 7.0) ends = vec2(min(low, 248.0) + 7.0, min(low, 248.0));
    vec2 centre = ends;
    // Tries 0: the range. 1: least squares. 2 to 10: its neighbours. 11: six values.
    bool has_six = inner_low <= inner_high;
    int tries = BC4_TRIES;
    for (int number = 0; number < tries; ++number) {
        vec2 tried = centre;
        if (number >= 2) {
            int place = number - 2;
            tried += vec2(place % 3 - 1, place / 3 - 1);
        }
        if (number == 11) tried = vec2(inner_low, inner_high);
        tried = clamp(tried, 0.0, 255.0);
        bool fits = number == 11 ? has_six : tried.x > tried.y;
        float tried_error = bc4_error(values, tried.x, tried.y, indices);
        if (fits && tried_error < best) {
            best = tried_error;
            ends = tried;
            best_indices = indices;
        }
        if (number == 0) {
            // The ends with the least squared error for these indices.
            float first_squared = 0.0, mixed = 0.0, second_squared = 0.0, firsts = 0.0, seconds_sum = 0.0;
            for (int row = 0; row < 4; ++row) {
                vec4 weight = best_indices[row], rest = 7.0 - weight;
                first_squared += dot(rest, rest);
                mixed += dot(rest, weight);
                second_squared += dot(weight, weight);
                firsts += dot(rest, values[row]);
                seconds_sum += dot(weight, values[row]);
            }
            precise float determinant = first_squared * second_squared - mixed * mixed;
            if (determinant > 0.0) {
                precise float first = (second_squared * firsts - mixed * seconds_sum) / determinant * 7.0;
                precise float second = (first_squared * seconds_sum - mixed * firsts) / determinant * 7.0;
                centre = clamp(floor(vec2(first, second) + 0.5), 0.0, 255.0);
            }
        }
        if (best == 0.0) tries = 0;
    }
    error = best / 1225.0;
    bool six = ends.x <= ends.y;
    uvec2 block = uvec2(uint(ends.x) | (uint(ends.y) << 8), 0u);
    for (int number = 0; number < 16; ++number) {
        uint code = bc4_code(best_indices[number >> 2][number & 3], six);
        int at = 16 + 3 * number;
        block.x |= at < 32 ? code << uint(at) : 0u;
        block.y |= at >= 32 ? code << uint(at - 32) : (at > 29 ? code >> uint(32 - at) : 0u);
    }
    return block;
}
