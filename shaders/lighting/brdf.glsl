// The reflection of a surface: metallic-roughness as in glTF 2.0, appendix B (viewer/lighting/brdf.py is the same in float64).

struct Reflection {
    vec3 diffuse;             // albedo below a dielectric's surface, without transmitted light
    vec3 metal;               // reflectance of the metal at normal incidence
    vec3 dielectric;          // reflectance of the dielectric's surface at normal incidence
    float dielectric_grazing;
    float metalness;
    float roughness;          // perceptual
};

// The view of a surface, the same for all lights: cosine to the viewer, and the specular lobe's directional albedo f0 * x + f90 * y.
struct Seen {
    vec3 normal;
    vec3 view;
    float cosine;
    vec2 albedo;
};

float largest(vec3 color) {
    return max(color.r, max(color.g, color.b));
}

float power5(float x) {
    float x2 = x * x;
    return x2 * x2 * x;
}

// Radiance towards the viewer for irradiance 1 on a surface that faces the light.
vec3 light_response(Reflection surface, Seen seen, vec3 light) {
    float light_cosine = dot(seen.normal, light);
    if (light_cosine <= 0.0) return vec3(0.0);
    float rough = max(surface.roughness, SMALLEST_ROUGHNESS);
    float a2 = rough * rough * rough * rough;
    vec3 between = seen.view + light;
    vec3 halfway = between * inversesqrt(max(dot(between, between), 1e-20));
    float half_cosine = clamp(dot(seen.normal, halfway), 0.0, 1.0);
    // In narrow lobes 1 - cosine^2 loses its digits; the sine does not.
    vec3 across = cross(seen.normal, halfway);
    float spread = half_cosine * half_cosine * a2 + dot(across, across);
    float visible = light_cosine * sqrt(seen.cosine * seen.cosine * (1.0 - a2) + a2)
        + seen.cosine * sqrt(light_cosine * light_cosine * (1.0 - a2) + a2);
    float lobe = a2 / (PI * spread * spread) * 0.5 / max(visible, 1e-30);
    float grazing = power5(1.0 - clamp(dot(seen.view, halfway), 0.0, 1.0));
    vec3 metal = surface.metal + (1.0 - surface.metal) * grazing;
    vec3 dielectric = surface.dielectric + (surface.dielectric_grazing - surface.dielectric) * grazing;
    float lost = 1.0 / max(seen.albedo.x + seen.albedo.y, 1e-3) - 1.0;
    vec3 mirrored = mix(dielectric * (1.0 + surface.dielectric * lost), metal * (1.0 + surface.metal * lost), surface.metalness);
    float passed = (1.0 - largest(dielectric)) * (1.0 - surface.metalness);
    return (surface.diffuse * (passed / PI) + mirrored * lobe) * light_cosine;
}

// Light that is scattered more than once between microfacets (Fdez-Aguera 2019).
vec3 multiple_scattering(vec3 f0, float f90, vec3 single, float lost) {
    vec3 average = f0 + (f90 - f0) / 21.0;
    return lost * single * average / (1.0 - average * lost);
}

// Radiance towards the viewer: `specular` around the mirrored view, `irradiance` over pi around the normal.
vec3 environment_response(Reflection surface, Seen seen, vec3 specular, vec3 irradiance) {
    float lost = 1.0 - (seen.albedo.x + seen.albedo.y);
    vec3 single = surface.dielectric * seen.albedo.x + surface.dielectric_grazing * seen.albedo.y;
    vec3 multiple = multiple_scattering(surface.dielectric, surface.dielectric_grazing, single, lost);
    vec3 metal_single = surface.metal * seen.albedo.x + seen.albedo.y;
    vec3 metal_multiple = multiple_scattering(surface.metal, 1.0, metal_single, lost);
    float passed = 1.0 - largest(single + multiple);
    vec3 scattered = mix(multiple + surface.diffuse * passed, metal_multiple, surface.metalness);
    return specular * mix(single, metal_single, surface.metalness) + irradiance * scattered;
}
