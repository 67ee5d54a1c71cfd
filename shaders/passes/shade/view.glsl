// Rays of the picture, and the direction of the sun.

// The direction of a pixel's ray is ray_middle + x * ray_right + y * ray_up in normalized device coordinates.
uniform vec3 ray_middle;
uniform vec3 ray_right;
uniform vec3 ray_up;
uniform vec2 picture_size;
uniform float exposure_factor;
// Unit vector towards the sun.
uniform vec3 sun_direction;
