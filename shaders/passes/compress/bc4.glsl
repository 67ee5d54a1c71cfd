// BC4 of 16 values: the ends of the palette's eight values that fit best, or of its six between 0 and 1. As ntc/c/ntc.c, with ends
// found by least squares first.

// Values by row: whole numbers from 0 to 255. Returns the squared error times 25 * 49, a whole number but for rounding.
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
            // The two values beside the six.
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

// The stored number of a place along the palette.
uint bc4_code(float place, bool six) {
    if (six && place >= 6.0) return uint(place);
    float last = six ? 5.0 : 7.0;
    return place == 0.0 ? 0u : (place == last ? 1u : uint(place) + 1u);
}

uvec2 compress_bc4(vec4 values[4], out float error) {
    float low = 255.0, high = 0.0, inner_low = 255.0, inner_high = 0.0;
    for (int row = 0; row < 4; ++row) {
        vec4 own = values[row];
        low = min(low, min(min(own.x, own.y), min(own.z, own.w)));
        high = max(high, max(max(own.x, own.y), max(own.z, own.w)));
        vec4 above = mix(own, vec4(255.0), equal(own, vec4(0.0))), below = mix(own, vec4(0.0), equal(own, vec4(255.0)));
        inner_low = min(inner_low, min(min(above.x, above.y), min(above.z, above.w)));
        inner_high = max(inner_high, max(max(below.x, below.y), max(below.z, below.w)));
    }
    float best = 1e30;
    vec2 ends = vec2(high, low);
    vec4 indices[4], best_indices[4];
    for (int row = 0; row < 4; ++row) best_indices[row] = vec4(0.0);
    // Eight neighbouring numbers need no rounding.
    if (high - low < 7.0) ends = vec2(min(low, 248.0) + 7.0, min(low, 248.0));
    vec2 centre = ends;
    // The ends as they are, those that suit the indices best, their neighbours, and six values.
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
        float found = bc4_error(values, tried.x, tried.y, indices);
        if (fits && found < best) {
            best = found;
            ends = tried;
            best_indices = indices;
        }
        if (number == 0) {
            // The ends that suit these indices best.
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
