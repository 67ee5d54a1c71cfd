// A surface's normal and tangent in world space, in two words: octahedral coordinates (Cigolle et al. 2014).

struct Frame {
    vec3 normal;      // unit, on the visible side
    vec3 tangent;     // unit, along u
    float handedness; // 1 or -1: bitangent = handedness * cross(normal, tangent), along -v (glTF 2.0, Sec. 3.7.2.1)
};

// An even number of steps makes the axes exact.
const float TANGENT_STEPS = 32766.0;

// `direction` must not be 0.
vec2 to_octahedron(vec3 direction) {
    vec3 flat_direction = direction / max(abs(direction.x) + abs(direction.y) + abs(direction.z), 1e-30);
    vec2 folded = (1.0 - abs(flat_direction.yx)) * mix(vec2(-1.0), vec2(1.0), greaterThanEqual(flat_direction.xy, vec2(0.0)));
    return flat_direction.z >= 0.0 ? flat_direction.xy : folded;
}

vec3 from_octahedron(vec2 place) {
    vec3 direction = vec3(place, 1.0 - abs(place.x) - abs(place.y));
    vec2 unfolded = (1.0 - abs(place.yx)) * mix(vec2(-1.0), vec2(1.0), greaterThanEqual(place, vec2(0.0)));
    direction.xy = direction.z >= 0.0 ? place : unfolded;
    return normalize(direction);
}

uvec2 pack_frame(Frame frame) {
    uvec2 tangent = uvec2(clamp(to_octahedron(frame.tangent) * 0.5 + 0.5, 0.0, 1.0) * TANGENT_STEPS + 0.5);
    uint bits = tangent.x | (tangent.y << 15) | (frame.handedness < 0.0 ? 0x80000000u : 0u);
    return uvec2(packSnorm2x16(to_octahedron(frame.normal)), bits);
}

Frame unpack_frame(uvec2 words) {
    vec2 tangent = vec2(words.y & 32767u, (words.y >> 15) & 32767u) / TANGENT_STEPS * 2.0 - 1.0;
    return Frame(
        from_octahedron(unpackSnorm2x16(words.x)),
        from_octahedron(tangent),
        (words.y & 0x80000000u) != 0u ? -1.0 : 1.0
    );
}
