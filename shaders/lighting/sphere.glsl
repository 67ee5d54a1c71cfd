// Maps of all directions: equirectangular, octahedral, cube (viewer/lighting/directions.py). Y is up, north is -Z.

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

vec3 map_direction(vec2 place) {
    vec2 planar = place * 2.0 - 1.0;
    float y = 1.0 - abs(planar.x) - abs(planar.y);
    vec2 across = y >= 0.0 ? planar : (1.0 - abs(planar.yx)) * map_sign(planar);
    return normalize(vec3(across.x, y, across.y));
}

// x: face of a cube; yz: place on it, in [0, 1]. Faces 0 to 5 are +X, +Y, +Z, -X, -Y, -Z. The two coordinates run along the next two axes,
// cyclically: y and z on +X.
vec3 cube_place(vec3 direction) {
    vec3 size = abs(direction);
    bool is_x = size.x >= size.y && size.x >= size.z;
    bool is_y = !is_x && size.y >= size.z;
    vec3 turned = is_x ? direction : (is_y ? direction.yzx : direction.zxy);
    float face = (is_x ? 0.0 : (is_y ? 1.0 : 2.0)) + (turned.x < 0.0 ? 3.0 : 0.0);
    return vec3(face, turned.yz / max(abs(turned.x), 1e-30) * 0.5 + 0.5);
}

vec3 cube_direction(int face, vec2 place) {
    vec3 turned = vec3(face < 3 ? 1.0 : -1.0, place * 2.0 - 1.0);
    int axis = face % 3;
    return normalize(axis == 0 ? turned : (axis == 1 ? turned.zxy : turned.yzx));
}
