// The plane is a uniform: one program serves all planes. For shaders that decode nothing.
#define ANY_PLANE 1
#define PLANE plane_number
uniform int plane_number;
