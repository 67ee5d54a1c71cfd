// All directions as pictures: equirectangular and octahedral (viewer/lighting/directions.py). Y is up, north is -Z.

const float PI = 3.14159265358979;

vec2 panorama_place(vec3 direction) {
    float y = clamp(direction.y * inversesqrt(max(dot(direction, direction), 1e-30)), -1.0, 1.0);
    return vec2(atan(direction.x, -direction.z) / (2.0 * PI) + 0.5, acos(y) / PI);
}

vec2 map_sign(vec2 value) {
    return mix(vec2(-1.0), vec2(1.0), greaterThanEqual(value, vec2(0.0)));
}

vec2 map_place(vec3 direction) {
    vec3 scaled = direction / max(abs(direction.x) + abs(direction.y) + abs(direction.z), 1e-30);
    vec2 folded = (1.0 - abs(scaled.zx)) * map_sign(scaled.xz);
    return (scaled.y >= 0.0 ? scaled.xz : folded) * 0.5 + 0.5;
}

// Also up to half a map beyond its edges, where the sphere goes on.
vec3 map_direction(vec2 place) {
    vec2 planar = place * 2.0 - 1.0;
    bvec2 outside = greaterThan(abs(planar), vec2(1.0));
    vec2 mirrored = mix(planar, map_sign(planar) * 2.0 - planar, outside);
    planar = mix(mirrored, -mirrored, outside.yx);
    float y = 1.0 - abs(planar.x) - abs(planar.y);
    vec2 across = y >= 0.0 ? planar : (1.0 - abs(planar.yx)) * map_sign(planar);
    return normalize(vec3(across.x, y, across.y));
}
